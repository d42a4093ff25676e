// The instruction sets every x_simd.cpp is compiled for (Highway picks the best one at run time): AVX-512, AVX2, and
// what every machine of the architecture has. The ones in between would cost compile time and bring nothing here.
// Define HWY_TARGET_INCLUDE, then include this, then the -inl.h files. No include guard: it is read once a target.
#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#endif
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on
