#include "birefit/error.h"

#include <utility>

#include "core/printable.h"

namespace birefit {

std::string to_string(const Problem& problem) {
  std::string text;
  if (!problem.where.file.empty()) {
    text += printable(problem.where.file);
    if (problem.where.line > 0) text += ":" + std::to_string(problem.where.line);
    if (problem.where.line > 0 && problem.where.column > 0) text += ":" + std::to_string(problem.where.column);
    text += ": ";
  }
  text += printable(problem.what);
  if (!problem.hint.empty()) text += "; " + printable(problem.hint);
  return text;
}

UserError::UserError(std::vector<Problem> problems) : problems_(std::move(problems)) {
  for (const Problem& problem : problems_) text_ += (text_.empty() ? "" : "\n") + to_string(problem);
}

UserError::UserError(Where where, std::string what, std::string hint)
    : UserError(std::vector<Problem>{{std::move(where), std::move(what), std::move(hint)}}) {}

void Problems::add(Where where, std::string what, std::string hint) {
  problems_.push_back({std::move(where), std::move(what), std::move(hint)});
}

void Problems::add(const UserError& error) {
  problems_.insert(problems_.end(), error.problems().begin(), error.problems().end());
}

void Problems::throw_if_any() const {
  if (!problems_.empty()) throw UserError(problems_);
}

}  // namespace birefit
