#pragma once
// Pictures by gnuplot, for the commands that measure.

#include <filesystem>
#include <string>

namespace birefit {

/// Draws `picture` by a script without `set output`: no name of a file or folder is ever part of a script. False (and a
/// message to stderr, and no picture) when gnuplot is not there or fails; UserError where the picture cannot be
/// written.
bool draw(const std::string& script, const std::filesystem::path& picture);
/// Text of somebody else's as a string of a script, quotes included: between single quotes, in which gnuplot
/// substitutes nothing (between double quotes it runs what stands between backticks); control characters, line ends
/// too, become spaces.
std::string plot_text(const std::string& text);
/// Makes the folder; UserError when it cannot.
void make_folder(const std::string& folder);
/// As CSV: empty when not finite.
std::string csv_number(double x);

/// Okabe and Ito's colours and one of Tol's, told apart by every eye.
inline constexpr const char* kColours[] = {"#999999", "#000000", "#F0E442", "#E69F00", "#D55E00",
                                           "#CC79A7", "#0072B2", "#56B4E9", "#882255", "#009E73"};
/// The methods in the order of kColours.
inline constexpr const char* kChartedMethods[] = {"layers_edge", "layers_midpoint", "ode_operator", "ode_scalar",
                                                  "wei_norman",  "wei_norman_exp",  "magnus4",      "magnus6",
                                                  "modal",       "diagonal"};

}  // namespace birefit
