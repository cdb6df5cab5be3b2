#pragma once
// Director fields of configs: read as they are described, but for those whose numbers depend on each other
// (docs/configuration.md).

#include <optional>
#include <string>

#include "birefit/scene.h"
#include "io/config/described.h"

namespace birefit {

/// From the block of its key in `parent`. Mistakes go to the reader's problems.
template <class Director>
Director read_director(ConfigReader& reader, const Block& parent) {
  Director director;
  // `radial:` with nothing behind it is as clear as `radial: {}`.
  const YamlNode* const node = parent.find(Director::kKey);
  const bool empty = node && node->kind == YamlNode::Kind::null;
  if constexpr (requires { Director::kMayBeEmpty; })
    if (empty) return director;
  read_numbers(reader, reader.block(parent, Director::kKey, described_keys<Director>(), true), director);
  return director;
}
template <>
UniformDirector read_director<UniformDirector>(ConfigReader&, const Block&);
template <>
AxialDirector read_director<AxialDirector>(ConfigReader&, const Block&);
template <>
FreederickszDirector read_director<FreederickszDirector>(ConfigReader&, const Block&);
template <>
HelixDirector read_director<HelixDirector>(ConfigReader&, const Block&);

/// The one of a variant's directors whose key is `kind`.
template <class Directors>
void read_one_of(ConfigReader& reader, const Block& parent, const std::optional<std::string>& kind, Directors& into) {
  each_kind<Directors>([&]<class Director>(const Director*) {
    if (kind == Director::kKey) into = read_director<Director>(reader, parent);
  });
}

}  // namespace birefit
