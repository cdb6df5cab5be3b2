#pragma once
// Colours as numbers: tristimulus values to CIELAB, the distance of two colours, and what a screen shows. All for
// reports and charts: the distance has no derivative at 0 and jumps at opposite hues, so that nothing is fitted by it.

namespace birefit {

/// Tristimulus values, in any unit that they share with the white beside them.
struct Xyz {
  double x = 0, y = 0, z = 0;
};
/// CIELAB, CIE 15 (ISO/CIE 11664-4): l from 0 (black) to 100 (the white).
struct Lab {
  double l = 0, a = 0, b = 0;
};
/// Shares of a screen's primaries; outside of [0, 1] where the screen cannot show a colour.
struct Rgb {
  double r = 0, g = 0, b = 0;
};

/// CIELAB against a white (each of its values above 0): of a picture its own lamp's.
Lab lab_of(const Xyz& colour, const Xyz& white);
/// The distance CIEDE2000 (ISO/CIE 11664-6) with all its weights 1; symmetric, 0 or more. Of hues that are opposite to
/// rounding, either of two values is right.
double ciede2000(const Lab&, const Lab&);

/// Linear sRGB (IEC 61966-2-1) of a colour under a white that is to look white: adapted by Bradford's matrix to D65.
/// Not clipped; the white is (1, 1, 1).
Rgb linear_srgb(const Xyz& colour, const Xyz& white);
/// The curve of sRGB, from light to code, both 1 for white; odd, so that it has an inverse below 0, too.
double srgb_code(double light);
/// Its inverse.
double srgb_light(double code);

}  // namespace birefit
