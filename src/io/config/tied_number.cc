#include "io/config/tied_number.h"

namespace birefit {

Where within(const YamlNode& word, int column) {
  Where where = word.where;
  if (where.line > 0) where.column += column - 1 + (word.quoted ? 1 : 0);
  return where;
}

std::shared_ptr<Expression> tie_in(const YamlNode& word) {
  if (!word.is_scalar() || !Expression::is_one(word.text)) return nullptr;
  try {
    auto expression = std::make_shared<Expression>(word.text);
    return expression->is_plain() ? nullptr : expression;
  } catch (const ExpressionError&) {
    return nullptr;  // said by who reads it as a number
  }
}

}  // namespace birefit
