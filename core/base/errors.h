// What can go wrong, by who has to act. The program maps InputError to exit code 2 and every other exception to 1.
//
//   InputError  the user's input is bad: one line that says what, where, and what would be right.
//   Failure     the work itself failed (disk full, the loss became NaN for good, …).
//   Cancelled   the user asked to stop; what was finished has been saved.
#pragma once

#include <spdlog/fmt/fmt.h>

#include <stdexcept>
#include <string>

namespace fieldgraft {

struct InputError : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct Failure : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct Cancelled : std::runtime_error {
    Cancelled() : std::runtime_error("cancelled") {}
};

template <class... Args>
[[noreturn]] void input_error(fmt::format_string<Args...> format, Args&&... args) {
    throw InputError(fmt::format(format, std::forward<Args>(args)...));
}
template <class... Args>
[[noreturn]] void failure(fmt::format_string<Args...> format, Args&&... args) {
    throw Failure(fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace fieldgraft
