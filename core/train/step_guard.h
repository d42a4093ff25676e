// What happens when a step of training goes wrong: one rule for fields and for edits.
//
//   a NaN or Inf in loss or gradient   the step is left out and counted, the learning rate halved for a while
//   `skips` of these in a row,         everything learnt goes back to the last good state (kept in memory, renewed
//   a loss that blows up, or a         every `interval` steps) and the learning rate stays halved
//   share `idle` without any gradient
//   more than `roll_backs` of those    given up; the state is then the last good one
//
// A loss has blown up when its running mean (19 parts of 20 the mean before) exceeds `collapse` times its lowest, or
// `worse` times the mean of the first `first_steps` ones, and a floor. It is looked at from the 64th step after the
// start or a roll-back on. Without gradients while there is a loss left, networks are dead (no ReLU opens, nothing is
// dense). A state is good when it is finite, not dead, and its running mean below twice the lowest. Healthy runs are
// not touched: not a bit of them depends on the guard.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "core/base/json.h"
#include "core/base/torch.h"

namespace fieldgraft {

struct GuardLimits {
    std::int64_t skips = 8, roll_backs = 8, interval = 256, first_steps = 2;
    double collapse = 8, worse = 1.25, floor = 1e-4, idle = 0.25;
};

// The part that travels in checkpoints.
struct GuardState {
    std::int64_t taken = 0, steps = 0;  // in all; since the last roll-back
    std::int64_t skipped = 0, skipped_in_a_row = 0, roll_backs = 0;
    double scale = 1, most = 1;               // of the learning rate: now, and what it may return to
    double idle = 0;                          // running share of steps without any gradient
    double level = 0, lowest = 0, first = 0;  // of the loss: running mean, the lowest of it, mean of the first steps

    Json to_json() const;  // doubles by their bits: a resumed run is the same run
    static GuardState from_json(const Json& json);
};

class StepGuard {
  public:
    using Tensors = std::map<std::string, Tensor>;
    struct Access {
        std::function<Tensors()> tensors;              // all that is learnt; may share the run's memory
        std::function<void(const Tensors&)> put_back;  // copies them back into the run
    };
    enum class Outcome { taken, skipped, rolled_back, given_up };

    // `state` is the run's, and must outlive the guard.
    StepGuard(GuardState& state, Access access, GuardLimits limits = {});

    // Called after every step with whether it was taken (an optimiser leaves out what is not finite), and whether all
    // of its gradients were 0.
    Outcome after_step(bool taken, double loss, std::int64_t iteration, bool idle = false);
    // Makes the run's state the good one to return to: at the start, and after a checkpoint was read.
    void keep(std::int64_t iteration);
    // At the end: goes back to the last good state if the loss is far above what it was there. True if it did.
    bool settle();

    // Why it last rolled back, and to where: "8 steps in a row had …; back to the state of iteration 512, …".
    const std::string& reason() const { return reason_; }

  private:
    bool blown_up() const;
    void follow(double loss);
    void put_back();
    Outcome roll_back(const std::string& why);

    GuardState& state_;
    Access access_;
    GuardLimits limits_;
    Tensors good_;
    double good_level_ = 0;
    std::int64_t good_iteration_ = 0;
    std::string reason_;
};

}  // namespace fieldgraft
