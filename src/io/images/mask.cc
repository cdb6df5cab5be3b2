#include "io/images/mask.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace birefit {

LoadedMask load_mask(const ImageRequest& request, const std::function<LoadedImage(const ImageRequest&)>& load) {
  ImageRequest asked = request;
  asked.mask = true;
  LoadedImage image = load(asked);
  // Programs that compute with masks (ImageJ) store what is selected as the top code and show it black through an
  // inverting lookup table: what is stored counts. Of one bit nothing but what is shown is meant.
  const bool white_is_zero = image.stored_zero != 0, stored_decides = white_is_zero && image.top_code != 1;
  LoadedMask mask;
  mask.notes = std::move(image.notes);
  mask.width = image.width, mask.height = image.height;
  mask.selected = Mask(image.values.width(), image.values.height(), 0);
  long count = 0;
  for (std::size_t i = 0; i < mask.selected.size(); ++i) {
    const double shown = image.values.values()[i], left_out = stored_decides ? image.stored_zero : 0;
    mask.selected.values()[i] = std::isfinite(shown) && shown != left_out;
    count += mask.selected.values()[i];
  }
  const char* which = stored_decides  ? "those not stored as 0 (white is zero in this file: they are shown dark)"
                      : white_is_zero ? "those shown white (white is zero in this file: they are stored as 0)"
                                      : "those that are not 0";
  const bool whole = mask.selected.width() == mask.width && mask.selected.height() == mask.height;
  mask.notes.push_back(fmt::format(
      "of the mask's {} pixels {}{} are taken as selected, {}", mask.selected.size(), whole ? "" : "around the region ",
      count == static_cast<long>(mask.selected.size()) ? "all" : fmt::format("{}", count), which));
  return mask;
}

}  // namespace birefit
