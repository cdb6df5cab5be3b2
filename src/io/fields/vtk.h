#pragma once
// VTK's files: XML image data (.vti) and the legacy format (.vtk).
// https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
// https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html

#include <string>
#include <vector>

#include "io/fields/raw_volume.h"

namespace birefit::fields {

RawVolume read_vti(std::string content, const VolumeRequest& request);
RawVolume read_legacy_vtk(const std::string& content, const VolumeRequest& request);

// ---- what both share
// -------------------------------------------------------------------------------------------------

/// Bytes of a number of one of VTK's types ("Float32", .., in the words of either format); 0 = unknown.
std::size_t size_of_type(const std::string& type);
double number_of_type(const std::string& type, const char* from, bool swapped);

/// Numbers separated by white space; throws naming the first that is none.
void read_ascii(std::string_view text, const std::string& file, const std::string& name, std::size_t most,
                std::vector<double>& values);

/// The director or tensor of a file among the names of its arrays: `request.array`, else n or Q.
std::string chosen_array(const VolumeRequest& request, const std::vector<std::string>& names);

/// Takes the array as director or tensor by its number of components: 3, 6 in VTK's order, or 9.
void take_field(NodeArray array, const std::string& name, RawVolume& raw);

}  // namespace birefit::fields
