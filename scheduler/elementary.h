// Elementary functions that have the same bits on every processor.
//
// A C library chooses among several versions of its sines and logarithms by what the processor can
// do (fused multiplication, for one), and these differ in their last bits. Whatever reaches a byte of
// an output uses these instead, which are made of +, -, *, / and square roots: IEEE 754 rounds those
// alike everywhere. tests/house/layering_test.py refuses the library's.
// Guarantees: the errors below, measured against long double by tests/scheduler/elementary_test.cpp, in units
// in the last place (ulp) of the result. Angles are in degrees, whose multiples of 90 are exact, as
// poles and the antimeridian need it.
#pragma once

namespace qmpipe {

struct SinCos {
  double sin = 0;
  double cos = 1;
};

// Within 2 ulp. REQUIRES: |angle_deg| <= 1e6.
SinCos sin_cos_deg(double angle_deg);
inline double sin_deg(double angle_deg) { return sin_cos_deg(angle_deg).sin; }
inline double cos_deg(double angle_deg) { return sin_cos_deg(angle_deg).cos; }

// The angle from the x axis to (x, y), -180 .. 180, with the sign of y; 0 or 180 with that sign
// where y is zero. Within 3 ulp.
double atan2_deg(double y, double x);

// e to the power of x, within 1.5 ulp; 0 or infinity where a double cannot hold it.
double exponential(double x);

// Within 2.5 ulp for |x| <= 20.
double hyperbolic_sine(double x);

// Of base e, within 1.5 ulp. REQUIRES: x > 0.
double logarithm(double x);

// Of base 10, within 2.5 ulp, exact for the powers of ten that a double holds. REQUIRES: x > 0.
double decimal_logarithm(double x);

// x to the power of y, within 2 + |y log(x)| * 2 ulp. REQUIRES: x > 0.
double power(double x, double y);

// The same for whole numbers, of any sign, by multiplication: exact where the result is and n >= 0.
double whole_power(double x, int n);

}  // namespace qmpipe
