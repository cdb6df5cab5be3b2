#include <opencv2/imgproc.hpp>

#include "io/libraries/table.h"

namespace birefit {

Grid<float> median_of_neighbours(const Grid<float>& values) {
  Grid<float> medians(values.width(), values.height());
  // OpenCV only reads what it is given first, though its header of foreign memory is not const.
  const cv::Mat from(values.height(), values.width(), CV_32F, const_cast<float*>(values.values().data()));
  cv::Mat to(values.height(), values.width(), CV_32F, medians.values().data());
  cv::medianBlur(from, to, 5);
  return medians;
}

}  // namespace birefit
