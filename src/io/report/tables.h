#pragma once
// A report's tables: estimates, what they hang on, what the data are.

#include <string>

#include "birefit/io.h"

namespace birefit::page {

/// The estimates that were asked for, for the top of the page.
std::string key_numbers(const FitResult& result);
std::string parameter_table(const FitResult& result);
/// What is tied, and what `report:` asked for; "" where there is none.
std::string derived_table(const FitResult& result);
std::string statistics_section(const Config& config, const FitResult& result);
std::string correlation_table(const FitResult& result);
/// How the branches of the sample compare.
std::string branch_table(const FitResult& result);
/// What the fit took as exact, and what that does to the estimates.
std::string input_table(const FitResult& result);
std::string stated_table(const FitResult& result);
std::string departures_table(const FitResult& result);
std::string coverage_table(const FitResult& result);
std::string identifiability(const Config& config, const FitResult& result);
std::string model_section(const Config& config, const FitResult& result);
std::string data_section(const Config& config, const FitResult& result);

}  // namespace birefit::page
