#include "io/report/marks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace birefit {
namespace {

/// Of which places of a series something can be drawn, and where.
struct Places {
  const DataSeries& series;
  const AxisScale &x, &y;
  std::size_t count = std::min(series.x.size(), series.y.size());
  std::size_t intervals = std::min({count, series.low.size(), series.high.size()});
  double top = std::min(y.from, y.to) - 2, bottom = std::max(y.from, y.to) + 2;

  bool drawable(std::size_t i) const { return x.has(series.x[i]) && y.has(series.y[i]); }
  bool inside(std::size_t i) const {
    const double v = y(series.y[i]);
    return drawable(i) && v >= top && v <= bottom;
  }
  /// What has no end, or none on a logarithmic axis, ends out of sight.
  double end(double value) const {
    if (y.log && !(value > 0)) return bottom;
    return std::isinf(value) ? (value > 0 ? top : bottom) : std::clamp(y(value), top - 500, bottom + 500);
  }
  bool interval(std::size_t i) const {
    return i < intervals && x.has(series.x[i]) && !std::isnan(series.low[i]) && !std::isnan(series.high[i]);
  }
  double low(std::size_t i) const { return end(series.low[i]); }
  double high(std::size_t i) const { return end(series.high[i]); }
};

std::string line(const Places& at, const DataSeries& series) {
  std::string path;
  bool pen_down = false;
  for (std::size_t i = 0; i < at.count; ++i) {
    if (!at.drawable(i)) {
      pen_down = false;
      continue;
    }
    path += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", at.x(series.x[i]),
                        std::clamp(at.y(series.y[i]), at.top - 500, at.bottom + 500));
    pen_down = true;
  }
  return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"/>", path,
                     series.colour, series.width);
}

std::string dots(const Places& at, const DataSeries& series, double diameter) {
  // One path of zero-length round strokes is a tenth of as many circles.
  std::string path;
  for (std::size_t i = 0; i < at.count; ++i)
    if (at.inside(i)) path += fmt::format("M{:.1f} {:.1f}h0", at.x(series.x[i]), at.y(series.y[i]));
  return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\"/>", path,
                     series.colour, diameter);
}

/// A hollow circle or a triangle as a part of a path; of a triangle the centre of mass is the place.
std::string shape(DataSeries::Mark mark, double x, double y, double size) {
  const double r = size / 2;
  if (mark == DataSeries::Mark::circle)
    return fmt::format("M{:.1f} {:.1f}a{:.2f} {:.2f} 0 1 0 {:.2f} 0a{:.2f} {:.2f} 0 1 0 {:.2f} 0z", x - r, y, r, r,
                       size, r, r, -size);
  const double up = mark == DataSeries::Mark::up ? 1 : -1;
  return fmt::format("M{:.1f} {:.1f}l{:.2f} {:.2f}h{:.2f}z", x, y - up * 1.15 * r, r, up * 1.73 * r, -size);
}

std::string shapes(const std::string& path, const DataSeries& series) {
  return series.mark == DataSeries::Mark::circle
             ? fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.4\"/>", path, series.colour)
             : fmt::format("<path d=\"{}\" fill=\"{}\"/>", path, series.colour);
}

std::string points(const Places& at, const DataSeries& series) {
  if (series.mark == DataSeries::Mark::dot) return dots(at, series, series.width);
  std::string path;
  for (std::size_t i = 0; i < at.count; ++i)
    if (at.inside(i)) path += shape(series.mark, at.x(series.x[i]), at.y(series.y[i]), series.width);
  return shapes(path, series);
}

std::string bars(const Places& at, const DataSeries& series) {
  std::string out;
  const double half = at.count > 1 ? 0.5 * (series.x[1] - series.x[0]) : 0.5;
  for (std::size_t i = 0; i < at.count; ++i)
    if (at.drawable(i) && series.y[i] != 0)
      out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>",
                         at.x(series.x[i] - half) + 0.4, at.y(series.y[i]),
                         at.x(series.x[i] + half) - at.x(series.x[i] - half) - 0.8,
                         std::max(0.0, at.y(0) - at.y(series.y[i])), series.colour);
  return out;
}

std::string interval_bars(const Places& at, const DataSeries& series) {
  std::string path;
  for (std::size_t i = 0; i < at.intervals; ++i)
    if (at.interval(i)) path += fmt::format("M{:.1f} {:.1f}V{:.1f}", at.x(series.x[i]), at.low(i), at.high(i));
  return path.empty() ? path : fmt::format("<path d=\"{}\" stroke=\"{}\" stroke-width=\"1.2\"/>", path, series.colour);
}

/// A closed outline of every stretch of intervals that nothing interrupts.
std::string strip(const Places& at, const DataSeries& series) {
  std::string path;
  for (std::size_t from = 0, to; from < at.intervals; from = to + 1) {
    for (to = from; to < at.intervals && at.interval(to);) ++to;
    for (std::size_t i = from; i < to; ++i)
      path += fmt::format("{}{:.1f} {:.1f}", i == from ? "M" : "L", at.x(series.x[i]), at.high(i));
    for (std::size_t i = to; i > from; --i) path += fmt::format("L{:.1f} {:.1f}", at.x(series.x[i - 1]), at.low(i - 1));
    if (to > from) path += "z";
  }
  return path.empty() ? path : fmt::format("<path d=\"{}\" fill=\"{}\" fill-opacity=\"0.22\"/>", path, series.colour);
}

}  // namespace

std::string draw_series(const DataSeries& series, const AxisScale& x, const AxisScale& y) {
  const Places at{series, x, y};
  switch (series.kind) {
    case DataSeries::Kind::line:
      return strip(at, series) + line(at, series) + (series.dots > 0 ? dots(at, series, series.dots) : "");
    case DataSeries::Kind::points:
      return interval_bars(at, series) + points(at, series);
    case DataSeries::Kind::bars:
      return bars(at, series);
  }
  return {};
}

std::string legend_symbol(const DataSeries& series, double left, double middle) {
  const auto dot = [&](double diameter, double x) {
    return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\"/>", x, middle,
                       std::max(diameter / 2, 1.6), series.colour);
  };
  switch (series.kind) {
    case DataSeries::Kind::line: {
      std::string out = fmt::format("<path d=\"M{:.1f} {:.1f}h17\" stroke=\"{}\" stroke-width=\"{}\"/>", left, middle,
                                    series.colour, series.width);
      if (!series.low.empty())
        out += fmt::format(
            "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"17\" height=\"10\" fill=\"{}\" fill-opacity=\"0.22\"/>", left,
            middle - 5, series.colour);
      return series.dots > 0 ? out + dot(series.dots, left + 8.5) : out;
    }
    case DataSeries::Kind::points: {
      const std::string bar = series.low.empty()
                                  ? ""
                                  : fmt::format("<path d=\"M{:.1f} {:.1f}v12\" stroke=\"{}\" stroke-width=\"1.2\"/>",
                                                left + 10, middle - 6, series.colour);
      return bar + (series.mark == DataSeries::Mark::dot
                        ? dot(series.width, left + 10)
                        : shapes(shape(series.mark, left + 10, middle, series.width), series));
    }
    case DataSeries::Kind::bars:
      return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"14\" height=\"9\" fill=\"{}\"/>", left + 3,
                         middle - 4.5, series.colour);
  }
  return {};
}

}  // namespace birefit
