#pragma once
// What an ImageRequest asks for of a picture, wherever the picture is: a part of it, some of its channels.

#include <string>
#include <vector>

#include "birefit/io.h"

namespace birefit {

/// Throws UserError at the place of the request: "image 'NAME' " and what was found.
[[noreturn]] void refuse_image(const ImageRequest& request, const std::string& found, const std::string& hint);
/// Refuses what has more pixels on a side than can be held.
void check_image_size(const ImageRequest& request, int width, int height);
/// What is asked for of an image of this size; empty where the region is outside of it.
PixelRect part_asked(const ImageRequest& request, int width, int height);

/// ASCII letters only.
std::string lower_case(std::string text);

struct StoredChannel {
  std::string name;       ///< "R", "red", "layer.R", ..; "" = the picture does not say
  bool no_light = false;  ///< alpha, depth
};
/// Those of an array, which names none: of four the last says what is covered.
std::vector<StoredChannel> channels_of_array(std::size_t count);
/// Channels whose plain average is the image. Throws UserError where the request does not say which, or there is none
/// such. `palette`: they were expanded from one.
std::vector<int> channels_asked(const ImageRequest& request, const std::vector<StoredChannel>& stored, bool palette,
                                std::vector<std::string>& notes);

}  // namespace birefit
