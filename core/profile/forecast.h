// What training a field on a scene will come to, told from a short training of the scene on this machine.
//
//   PSNR(t) = p + (C − p) (1 − (t/t₀)^−r)      p after t₀ = 16 s
//
// A run closes part of the gap between where the short one ends and a level C that no scene of ours reached, the same
// part for every scene: a scene that is already sharp after t₀ has less to gain. C and r were fitted to four scenes
// (docs/accuracy-and-time.md has what it is worth on others). The short run is one of its own, its learning rate
// running out: a long one stopped early would tell of another schedule. PSNR is of the views that training reports on
// (Scene::validation_views).
#pragma once

#include <optional>

#include "core/base/progress.h"
#include "core/train/trainer.h"

namespace fieldgraft {

class Forecast {
  public:
    static constexpr double probe_seconds = 16, most_minutes = 60;

    // Throws std::invalid_argument unless psnr, that of the short run, is finite.
    explicit Forecast(double psnr);
    // Throws std::invalid_argument for less than the short run's time.
    double psnr_after(double minutes) const;
    // The least time, at most most_minutes, and never less than the short run's; none: not even then.
    std::optional<double> minutes_for(double psnr) const;

  private:
    double reached_;
};

// The short training. Throws what training throws.
struct Probe {
    Forecast forecast;
    TrainResult result;
};
Probe probe(const TrainingData& data, std::uint64_t seed, const Reporter& reporter);

}  // namespace fieldgraft
