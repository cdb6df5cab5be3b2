#include "io/config/volume.h"

#include "io/config/described.h"
#include "io/fields/volume_file.h"

namespace birefit {

SampledVolume read_sampled_volume(ConfigReader& reader, const Block& parent) {
  SampledVolume volume;
  const Block block =
      reader.block(parent, "volume", {"file", "array", "axes", "spacing_um", "bulk_order", "q_norm", "scale"}, true);
  volume.scale = read_described<SampledVolume>(reader, block, "scale");
  VolumeRequest request;
  const std::optional<std::string> axes = reader.choice(block, "axes", {"zyx", "xyz"});
  request.x_first = axes.value_or("zyx") == "xyz";
  NumberSpec order;
  order.lower = 0;
  order.lower_open = true;
  order.upper = 1e6;
  request.bulk_order = reader.plain(block, "bulk_order", order).value_or(0);
  NumberSpec norm;
  norm.lower = 0;
  norm.lower_open = true;
  norm.upper = 100;
  request.q_norm = reader.plain(block, "q_norm", norm).value_or(0);
  request.array = reader.text(block, "array").value_or("");
  bool readable = true;
  if (const YamlNode* spacing = block.find("spacing_um")) {
    NumberSpec step;
    step.unit = "um";
    step.lower = 0;
    step.lower_open = true;
    step.upper = 1000;
    std::array<double, 3> values{};
    if (!spacing->is_sequence() || spacing->items.size() != 3) {
      reader.problems.add(spacing->where, "spacing_um must be three numbers [dx, dy, dz], found " +
                                              (spacing->is_sequence() ? std::to_string(spacing->items.size()) + " items"
                                                                      : spacing->describe()));
      readable = false;
    } else {
      for (std::size_t i = 0; i < 3; ++i) {
        const std::optional<double> value = reader.value_of(spacing->items[i], "spacing_um", step);
        readable = readable && value;
        values[i] = value.value_or(1);
      }
    }
    request.spacing_um = values;
    request.where = spacing->where;
  }
  if (!block.find("file"))
    reader.missing(block, "file", "a director field, .npy, .npz, .vti, .vtk or text of open-Qmin");
  const std::optional<std::string> name = reader.text(block, "file");
  if (!name || !readable) return volume;
  request.path = reader.resolve(*name);
  request.content = reader.field_in_memory(request.path);
  if (!request.spacing_um) request.where = block.find("file")->where;
  if (axes && (request.path.extension() == ".vti" || request.path.extension() == ".vtk"))
    reader.problems.add(block.find("axes")->where, "axes belongs to .npy files: in a .vti x runs fastest",
                        "leave it out");
  try {
    LoadedVolume loaded = load_volume(request);
    volume.grid = loaded.grid;
    for (const std::string& warning : loaded.warnings) reader.warnings.push_back(warning);
  } catch (const UserError& error) {
    reader.problems.add(error);
  }
  return volume;
}

}  // namespace birefit
