#pragma once
// A JSON Schema of configs, for editors: what the structs of a scene describe of their numbers, and the other keys.

#include <string>

namespace birefit {

/// JSON Schema, draft 2020-12. It knows every number of a scene with unit, range and meaning; rules between keys are
/// the reader's alone, so that a config may satisfy it and still be refused.
std::string config_schema();

}  // namespace birefit
