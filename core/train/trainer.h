// Fitting a radiance field to images (Mildenhall et al. 2020, with the hash encoding of Müller et al. 2022).
//
// Every iteration: random rays over all training pixels; forward and backward over the samples they can see
// (ray_pass.h); one step of Adam. The loss is the mean squared error of sRGB colours over all backgrounds (ray_pass.h).
// The number of rays follows the number of visible samples, near `samples` an iteration. The learning rate falls from
// rate along a straight line to rate·rate_end over the run: by iterations, or by time when `minutes` is given; the
// march's step is four times the final one for the first 30 % of the run and twice until 80 %.
//
// By iterations nothing depends on the clock or on the number of threads: same seed and machine give the same bits,
// resumed or not. Checkpoints are written about every checkpoint_seconds and on a stop; a stop throws Cancelled after
// saving. What goes wrong with a step is step_guard.h's matter: left out, rolled back, or in the end Failure with the
// last good state saved.
#pragma once

#include <filesystem>
#include <optional>

#include "core/base/progress.h"
#include "core/field/radiance_field.h"
#include "core/kernels/field_mlp_simd.h"
#include "core/train/training_data.h"

namespace fieldgraft {

struct TrainOptions {
    std::optional<double> minutes;           // how long, or
    std::optional<std::int64_t> iterations;  // how many; neither: the preset's minutes
    std::string quality = "preview";         // draft 1, preview 3, final 10 minutes
    std::uint64_t seed = 0;
    std::optional<HashFieldConfig> field;  // none: what pays within the time
    std::int64_t samples = 1 << 15;        // visible samples an iteration aims at
    double rate = 2e-2, rate_end = 0.03;
    double step = 0;  // of the march at the end, model units; 0: the box diagonal / 1024
    int occupancy_resolution = 128;
    // Of the networks' products: "bfloat16" where the machine has them fast (field_mlp_amx.h; else float32), "float32".
    std::string precision = "bfloat16";
    double checkpoint_seconds = 30;
    double speed = 1;  // of this machine, times that on which the budgets' fields were chosen
    std::int64_t image_bytes = usual_image_bytes;  // of training images kept in memory; more are streamed

    // The preset's minutes, unless `minutes` says otherwise.
    double budget() const;
    // `field`, or one for the budget: small tables and narrow networks learn faster, larger ones further. Training
    // takes a smaller table still where there are few pixels.
    HashFieldConfig field_config() const;
    Precision network_precision() const;
    // Throws InputError with one line. Called by train_field.
    void check() const;
};

struct TrainReport {
    std::int64_t iterations = 0, skipped = 0, roll_backs = 0;
    std::int64_t samples = 0;  // visible samples that were fitted
    double seconds = 0;
    double psnr = 0;        // of the validation views (four at most), or of training views if there are none
    double peak_mib = 0;    // of the process
    std::string precision;  // what the networks were computed in
    Json to_json() const;
};

struct TrainResult {
    std::shared_ptr<RadianceField> field;  // frozen, with its occupancy
    TrainReport report;
};

// `checkpoint` empty: none is written. With `resume` a missing checkpoint is an InputError.
TrainResult train_field(const TrainingData& data, const TrainOptions& options, const Reporter& reporter = {},
                        const std::filesystem::path& checkpoint = {}, bool resume = false);
TrainResult train_field(const Scene& scene, const TrainOptions& options, const Reporter& reporter = {},
                        const std::filesystem::path& checkpoint = {}, bool resume = false);

}  // namespace fieldgraft
