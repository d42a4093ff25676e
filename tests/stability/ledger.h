// What the stability suite found: for every quantity, kind of hard input and path through the code the largest error,
// that of the textbook formula in float32, and what is promised. Tests add to it and fail beyond a promise;
// FIELDGRAFT_STABILITY_OUT names a file that it is written to at the end (bench/stability.py makes docs/stability.md of
// it).
//
// An error is |found − right| / unit. The unit is the sum of the sizes of the terms that make up the quantity, each
// times (1 + optical depth in front of it) where there is a depth: rounding of a depth A is a relative error of A ε in
// e⁻ᴬ. For a quantity whose terms have one sign it is |right| (1 + A). What lies below the smallest normal float is not
// counted.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

namespace fieldgraft::stability {

struct Promise {
    std::string quantity, part, path;  // part: "value" or "gradient"; path: "reference", "SIMD", "bfloat16", "torch"
    double bound;
    std::string unit;  // in words
};
// Every quantity that is promised something, with its bound.
const std::vector<Promise>& promises();
const Promise& promise(const std::string& quantity, const std::string& part, const std::string& path);

// The smallest normal float32: what is below is not counted.
constexpr double smallest = 1.1754944e-38;

class Ledger {
  public:
    // The errors of one number; fails the running test when `ours` is beyond the promise. naive < 0: no other formula.
    void add(const std::string& quantity, const std::string& part, const std::string& path, const std::string& input,
             double ours, double naive = -1);
    void write(const std::string& path) const;

  private:
    struct Row {
        double ours = 0, naive = -1, bound = 0;  // naive: the worst finite one; −1: none
        long cases = 0, naive_lost = 0;          // lost: NaN or Inf
    };
    std::map<std::array<std::string, 4>, Row> rows_;
};
Ledger& ledger();

}  // namespace fieldgraft::stability
