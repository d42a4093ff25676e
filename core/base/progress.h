// How long work reports itself and how it is asked to stop. Libraries never print: they call a Reporter.
//
// Events are JSON objects with an "event" key (docs/formats.md): progress {iteration, total, loss, psnr?, eta_s},
// preview {path}, warning {message}. The program adds done {…} itself, out of what the library returns.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <string>

#include "core/base/json.h"

namespace fieldgraft {

class Reporter {
  public:
    using Sink = std::function<void(const Json&)>;
    Reporter() = default;
    explicit Reporter(Sink sink, const std::atomic<bool>* stop = nullptr) : sink_(std::move(sink)), stop_(stop) {}

    void event(const Json& event) const {
        if (sink_) sink_(event);
    }
    void warning(const std::string& message) const { event({{"event", "warning"}, {"message", message}}); }
    // True once the user asked to stop: finish the step, save, throw Cancelled.
    bool stop_requested() const { return stop_ != nullptr && stop_->load(std::memory_order_relaxed); }
    const std::atomic<bool>* stop_flag() const { return stop_; }  // for work with a sink of its own

  private:
    Sink sink_;
    const std::atomic<bool>* stop_ = nullptr;
};

class Stopwatch {
  public:
    double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

  private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace fieldgraft
