#include "core/train/step_guard.h"

#include <algorithm>
#include <bit>

#include "core/base/errors.h"
#include "core/base/safetensors.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t young = 64;
constexpr double memory = 0.95;  // of the running mean

}  // namespace

Json GuardState::to_json() const {
    const auto bits = [](double value) { return std::to_string(std::bit_cast<std::uint64_t>(value)); };
    return {{"taken", taken},       {"steps", steps},
            {"skipped", skipped},   {"skipped_in_a_row", skipped_in_a_row},
            {"idle", bits(idle)},   {"roll_backs", roll_backs},
            {"scale", bits(scale)}, {"most", bits(most)},
            {"level", bits(level)}, {"lowest", bits(lowest)},
            {"first", bits(first)}};
}

GuardState GuardState::from_json(const Json& json) {
    const auto number = [&](const char* key) {
        return std::bit_cast<double>(std::uint64_t{std::stoull(json.at(key).get<std::string>())});
    };
    GuardState state;
    state.taken = json.at("taken").get<std::int64_t>();
    state.steps = json.at("steps").get<std::int64_t>();
    state.skipped = json.at("skipped").get<std::int64_t>();
    state.skipped_in_a_row = json.at("skipped_in_a_row").get<std::int64_t>();
    state.idle = number("idle");
    state.roll_backs = json.at("roll_backs").get<std::int64_t>();
    state.scale = number("scale");
    state.most = number("most");
    state.level = number("level");
    state.lowest = number("lowest");
    state.first = number("first");
    return state;
}

StepGuard::StepGuard(GuardState& state, Access access, GuardLimits limits)
    : state_(state), access_(std::move(access)), limits_(limits) {}

void StepGuard::keep(std::int64_t iteration) {
    const Tensors now = access_.tensors();
    if (!not_finite(now).empty()) return;
    for (const auto& [name, tensor] : now) {
        Tensor& kept = good_[name];
        if (kept.defined()) {
            kept.copy_(tensor.detach());
        } else {
            kept = tensor.detach().clone();
        }
    }
    good_level_ = state_.level;
    good_iteration_ = iteration;
}

void StepGuard::put_back() {
    access_.put_back(good_);
    state_.level = good_level_;
    state_.skipped_in_a_row = 0;
    state_.idle = 0;
}

bool StepGuard::blown_up() const {
    if (state_.steps < young || state_.level <= limits_.floor) return false;
    return state_.level > limits_.collapse * state_.lowest || state_.level > limits_.worse * state_.first;
}

void StepGuard::follow(double loss) {
    state_.level = state_.steps == 0 ? loss : memory * state_.level + (1 - memory) * loss;
    if (state_.taken < limits_.first_steps) state_.first += loss / static_cast<double>(limits_.first_steps);
    const bool settled = state_.steps >= young / 2;  // one loss alone says little
    if (state_.taken == 0 || settled) state_.lowest = std::min(state_.taken == 0 ? loss : state_.lowest, state_.level);
    ++state_.taken;
    ++state_.steps;
}

StepGuard::Outcome StepGuard::after_step(bool taken, double loss, std::int64_t iteration, bool idle) {
    if (!taken) {
        ++state_.skipped;
        state_.scale *= 0.5;
        if (++state_.skipped_in_a_row < limits_.skips) return Outcome::skipped;
        return roll_back(fmt::format("{} steps in a row had NaN or infinite gradients", state_.skipped_in_a_row));
    }
    state_.skipped_in_a_row = 0;
    state_.scale = std::min(state_.most, state_.scale * 1.01);
    follow(loss);
    state_.idle = 0.98 * state_.idle + (idle ? 0.02 : 0);
    if (state_.idle > limits_.idle && state_.level > limits_.floor)
        return roll_back(fmt::format("{:.0f} % of the steps had no gradient at all", 100 * state_.idle));
    if (blown_up())
        return roll_back(fmt::format("the loss rose to {:.3g}, from {:.3g} at best", state_.level, state_.lowest));
    const bool good = state_.steps >= young && state_.idle < 0.01 && state_.level <= 2 * state_.lowest;
    if (good && state_.steps % limits_.interval == 0) keep(iteration + 1);
    return Outcome::taken;
}

StepGuard::Outcome StepGuard::roll_back(const std::string& why) {
    put_back();
    ++state_.roll_backs;
    state_.steps = 0;
    state_.most *= 0.5;
    state_.scale = state_.most;
    reason_ = fmt::format("{}; back to the state after {} iterations, with 1/{:.0f} of the learning rate", why,
                          good_iteration_, 1 / state_.most);
    return state_.roll_backs > limits_.roll_backs ? Outcome::given_up : Outcome::rolled_back;
}

bool StepGuard::settle() {
    const bool bad =
        state_.steps >= young / 2 && state_.level > limits_.floor &&
        (state_.level > limits_.collapse / 2 * state_.lowest || state_.level > limits_.worse * state_.first);
    if (!bad || good_level_ >= state_.level) return false;
    put_back();
    return true;
}

}  // namespace fieldgraft
