#include "io/fields/npy.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <string_view>

#include <fmt/format.h>

#include "io/fields/blocks.h"
#include "io/files/byte_order.h"
#include "io/images/npy_array.h"

namespace birefit::fields {
namespace {

/// An array as it stands in the file.
struct NpyArray {
  NpyHeader header;
  std::string_view data;

  double number(std::size_t at) const { return header.number(data.data() + header.bytes * at); }
};

NpyRefusal refusal_of(const std::string& file) {
  return [&file](const std::string& found, const std::string& hint) { refuse(file, found, hint); };
}

NpyArray parse_npy(std::string_view content, const std::string& file) {
  NpyArray array{npy_header(content, refusal_of(file)), {}};
  array.data = content.substr(array.header.start);
  return array;
}

/// Once the shape is known to be one that can be held.
void check_data(const NpyArray& array, const std::string& file) {
  check_npy_size(array.header, array.header.start + array.data.size(), refusal_of(file));
}

/// Numbers with x running fastest, then y, then z, and the components of a node together. Of one step along z, y, x and
/// the component; the last two axes of (.., 3, 3) in rows or in columns, which a symmetric tensor does not mind.
NodeArray by_node(const NpyArray& array, std::size_t components, bool x_first) {
  const std::vector<std::size_t>& shape = array.header.shape;
  const std::array<std::size_t, 4> n{shape[0], shape[1], shape[2], components};
  std::array<std::size_t, 4> stride;
  for (std::size_t i = 0; i < 4; ++i) {
    stride[i] = 1;
    for (std::size_t k = 0; k < 4; ++k)
      if (array.header.fortran ? k < i : k > i) stride[i] *= n[k];
  }
  const std::size_t x = x_first ? 0 : 2, z = x_first ? 2 : 0;
  NodeArray field;
  field.components = static_cast<int>(components);
  field.values.reserve(n[0] * n[1] * n[2] * components);
  for (std::size_t k = 0; k < n[z]; ++k)
    for (std::size_t j = 0; j < n[1]; ++j)
      for (std::size_t i = 0; i < n[x]; ++i)
        for (std::size_t c = 0; c < components; ++c)
          field.values.push_back(array.number(k * stride[z] + j * stride[1] + i * stride[x] + c * stride[3]));
  return field;
}

RawVolume volume_of(const NpyArray& array, const VolumeRequest& request) {
  RawVolume raw;
  raw.file = request.path.string();
  raw.name = "the director";
  const std::vector<std::size_t>& shape = array.header.shape;
  const bool director = shape.size() == 4 && shape[3] == 3, six = shape.size() == 4 && shape[3] == 6,
             nine = shape.size() == 5 && shape[3] == 3 && shape[4] == 3;
  if (!director && !six && !nine) {
    const bool leading = shape.size() == 4 && (shape[0] == 3 || shape[0] == 6);
    refuse(raw.file,
           "has the shape " + (array.header.shape_text.empty() ? "()" : array.header.shape_text) + ", expected " +
               (request.x_first ? "(nx, ny, nz, 3)" : "(nz, ny, nx, 3)") +
               " for a director, .. 6) or .. 3, 3) for a tensor Q",
           leading ? "the components come last: numpy.moveaxis(array, 0, -1)" : "");
  }
  const std::size_t x = request.x_first ? 0 : 2, z = request.x_first ? 2 : 0;
  check_size(raw.file, static_cast<double>(shape[x]), static_cast<double>(shape[1]), static_cast<double>(shape[z]));
  raw.spacing_um = demand_spacing(request, request.path.extension().string());
  check_data(array, raw.file);
  raw.nx = static_cast<int>(shape[x]), raw.ny = static_cast<int>(shape[1]), raw.nz = static_cast<int>(shape[z]);
  raw.tensor = !director;
  if (raw.tensor) raw.name = "Q";
  raw.field = by_node(array, director ? 3 : six ? 6 : 9, request.x_first);
  if (nine) to_six(raw.field);
  return raw;
}

// ---- .npz: a zip archive
// ---------------------------------------------------------------------------------------------
// https://pkware.cachefly.net/webdocs/casestudies/APPNOTE.TXT

struct ZipEntry {
  std::uint64_t packed = 0, size = 0, offset = 0;
  int method = 0;
};

/// By the directory at the end of the archive: what stands before each file may leave its length open.
std::map<std::string, ZipEntry> zip_entries(const std::string& content, const std::string& file) {
  const auto damaged = [&] { refuse(file, "is a damaged or cut off archive", "save it again"); };
  const auto at = [&](std::uint64_t from, auto like) {
    if (from > content.size() || content.size() - from < sizeof like) damaged();  // sums could overflow
    return static_cast<std::uint64_t>(read_as<decltype(like)>(content.data() + from));
  };
  const std::size_t end = content.rfind("PK\5\6");
  if (end == std::string::npos) damaged();
  std::uint64_t count = at(end + 10, std::uint16_t{}), where = at(end + 16, std::uint32_t{});
  if (const std::size_t wide = content.rfind("PK\6\6", end); wide != std::string::npos && where == 0xffffffff)
    count = at(wide + 32, std::uint64_t{}), where = at(wide + 48, std::uint64_t{});
  std::map<std::string, ZipEntry> entries;
  for (std::uint64_t i = 0; i < count; ++i) {
    if (at(where, std::uint32_t{}) != 0x02014b50) damaged();
    ZipEntry entry;
    entry.method = static_cast<int>(at(where + 10, std::uint16_t{}));
    entry.packed = at(where + 20, std::uint32_t{}), entry.size = at(where + 24, std::uint32_t{});
    entry.offset = at(where + 42, std::uint32_t{});
    const std::uint64_t name = at(where + 28, std::uint16_t{}), extra = at(where + 30, std::uint16_t{}),
                        comment = at(where + 32, std::uint16_t{});
    if (where + 46 + name + extra + comment > content.size()) damaged();
    // Lengths of 8 bytes stand behind the name, those that do not fit above in this order.
    for (std::uint64_t e = where + 46 + name, stop = e + extra; e + 4 <= stop; e += 4 + at(e + 2, std::uint16_t{})) {
      if (at(e, std::uint16_t{}) != 1) continue;
      std::uint64_t next = e + 4;
      for (std::uint64_t* length : {&entry.size, &entry.packed, &entry.offset})
        if (*length == 0xffffffff) *length = at(next, std::uint64_t{}), next += 8;
    }
    entries[content.substr(where + 46, name)] = entry;
    where += 46 + name + extra + comment;
  }
  return entries;
}

std::string unzipped(const std::string& content, const std::string& name, const ZipEntry& entry,
                     const std::string& file) {
  const auto damaged = [&] { refuse(file, name + " in it is damaged or cut off", "save it again"); };
  if (entry.offset > content.size() || content.size() - entry.offset < 30) damaged();
  const char* head = content.data() + entry.offset;
  const std::uint64_t start = entry.offset + 30 + read_as<std::uint16_t>(head + 26) + read_as<std::uint16_t>(head + 28);
  if (start > content.size() || entry.packed > content.size() - start) damaged();
  const std::string_view packed = std::string_view(content).substr(start, entry.packed);
  if (entry.method == 0) return std::string(packed);
  if (entry.method != 8)
    refuse(file, fmt::format("{} in it is packed by method {}", name, entry.method),
           "numpy.savez(_compressed) writes 0 or 8");
  std::optional<std::string> bytes = unpacked(packed, entry.size, Packing::raw_deflate);
  if (!bytes) damaged();
  return std::move(*bytes);
}

/// S or domain_mask beside the field, of its shape.
NodeArray beside(const NpyArray& array, const RawVolume& raw, const std::string& name, bool x_first) {
  const std::array<std::size_t, 3> nodes{static_cast<std::size_t>(x_first ? raw.nx : raw.nz),
                                         static_cast<std::size_t>(raw.ny),
                                         static_cast<std::size_t>(x_first ? raw.nz : raw.nx)};
  const std::vector<std::size_t>& shape = array.header.shape;
  const std::size_t expected = shape.size() == 4 && shape[3] == 1 ? 4 : 3;
  if (shape.size() != expected || !std::equal(nodes.begin(), nodes.end(), shape.begin()))
    refuse(raw.file, name + " has the shape " + array.header.shape_text + ", that of " + raw.name + " is another",
           "one number for each node");
  check_data(array, raw.file);
  return by_node(array, 1, x_first);
}

}  // namespace

RawVolume read_npy(const std::string& content, const VolumeRequest& request) {
  return volume_of(parse_npy(content, request.path.string()), request);
}

RawVolume read_npz(const std::string& content, const VolumeRequest& request) {
  const std::string file = request.path.string();
  const std::map<std::string, ZipEntry> entries = zip_entries(content, file);
  std::vector<std::string> names;
  for (const auto& [name, unused] : entries)
    if (name.size() > 4 && name.substr(name.size() - 4) == ".npy") names.push_back(name.substr(0, name.size() - 4));
  const auto has = [&](const std::string& name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  std::string field = request.array;
  if (field.empty() && has("n") && has("Q")) refuse(file, "has both n and Q", "`array: n` or `array: Q` chooses one");
  if (field.empty())
    for (const char* usual : {"n", "Q", "director"})
      if (field.empty() && has(usual)) field = usual;
  if (field.empty() && names.size() == 1) field = names[0];
  if (field.empty() || !has(field))
    refuse(file, (field.empty() ? std::string("has no array n or Q") : "has no array " + field) + "; it has " + list,
           "`array: NAME` chooses the one with the director or with Q");
  const auto load = [&](const std::string& name) { return unzipped(content, name, entries.at(name + ".npy"), file); };
  const std::string bytes = load(field);
  RawVolume raw = volume_of(parse_npy(bytes, file), request);
  raw.name = field;
  for (const auto& [name, to] :
       {std::pair(std::string("S"), &raw.order), std::pair(std::string("domain_mask"), &raw.mask)})
    if (has(name) && name != field) {
      const std::string own = load(name);
      *to = beside(parse_npy(own, file), raw, name, request.x_first);
    }
  return raw;
}

}  // namespace birefit::fields
