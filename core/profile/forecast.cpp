#include "core/profile/forecast.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

constexpr double ceiling = 46.5, exponent = 0.18;

}  // namespace

Forecast::Forecast(double psnr) : reached_(psnr) {
    if (!std::isfinite(psnr)) throw std::invalid_argument(fmt::format("a forecast needs a PSNR, not {}", psnr));
}

double Forecast::psnr_after(double minutes) const {
    if (!(60 * minutes >= probe_seconds))
        throw std::invalid_argument(fmt::format("{} minutes are less than the probe takes", minutes));
    const double gap = std::max(0.0, ceiling - reached_);
    return reached_ + gap * (1 - std::pow(60 * minutes / probe_seconds, -exponent));
}

std::optional<double> Forecast::minutes_for(double psnr) const {
    if (psnr <= reached_) return probe_seconds / 60;
    if (psnr > psnr_after(most_minutes)) return {};
    const double left = (ceiling - psnr) / (ceiling - reached_);
    return probe_seconds * std::pow(left, -1 / exponent) / 60;
}

Probe probe(const TrainingData& data, std::uint64_t seed, const Reporter& reporter) {
    TrainOptions options;
    options.minutes = Forecast::probe_seconds / 60;
    options.seed = seed;
    TrainResult result = train_field(data, options, reporter);
    return {Forecast(result.report.psnr), std::move(result)};
}

}  // namespace fieldgraft
