#include "core/app/console.h"

#include <ATen/Parallel.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <iostream>
#include <thread>

#include "core/base/errors.h"
#include "core/base/process.h"
#include "core/base/torch.h"

namespace fieldgraft::app {
namespace {

std::atomic<bool> stop_requested{false};

// The first Ctrl-C asks for a clean stop; a second one ends the process at once.
void on_interrupt(int) {
    if (stop_requested.exchange(true)) _exit(130);
}

std::string duration(double seconds) {
    const auto total = static_cast<long>(seconds + 0.5);
    if (total >= 3600) return fmt::format("{}:{:02}:{:02}", total / 3600, total / 60 % 60, total % 60);
    return fmt::format("{}:{:02}", total / 60, total % 60);
}

std::string number(const Json& value) {
    if (value.is_number_float()) return fmt::format("{:.4g}", value.get<double>());
    return value.is_string() ? value.get<std::string>() : value.dump();
}

std::string progress_line(const std::string& label, const Json& event) {
    const double total = std::max(1.0, event.value("total", 1.0));
    const double share = std::clamp(event.value("iteration", 0.0) / total, 0.0, 1.0);
    constexpr int width = 28;
    const int filled = static_cast<int>(share * width);
    std::string line =
        fmt::format("{} {}{} {:3.0f}%", label, std::string(filled, '#'), std::string(width - filled, '.'), share * 100);
    for (const char* key : {"loss", "psnr"})
        if (event.contains(key) && event[key].is_number()) line += fmt::format("  {} {}", key, number(event[key]));
    if (const auto skipped = event.value("skipped", 0); skipped > 0)
        line += fmt::format("  {} steps left out", skipped);
    if (event.contains("eta_s")) line += fmt::format("  {} left", duration(event["eta_s"].get<double>()));
    return line;
}

// A bar that redraws itself on a terminal; a line every few seconds elsewhere.
class People {
  public:
    explicit People(std::string label) : label_(std::move(label)), terminal_(isatty(STDERR_FILENO) != 0) {}

    void show(const Json& event) {
        const std::string kind = event.value("event", "");
        if (kind == "progress") {
            show_progress(event);
        } else if (kind == "forecast") {
            const std::string what =
                event.contains("psnr") ? fmt::format("{:.1f} dB: ", event["psnr"].get<double>()) : "";
            std::fprintf(stderr, "%s%sabout %s\n", terminal_ ? "\r\033[K" : "", what.c_str(),
                         duration(60 * event.value("minutes", 0.0)).c_str());
        } else if (kind == "warning") {
            std::fprintf(stderr, "%swarning: %s\n", terminal_ ? "\r\033[K" : "", event.value("message", "").c_str());
        }
    }

  private:
    void show_progress(const Json& event) {
        const bool last = event.value("iteration", 0.0) >= event.value("total", 1.0);
        const auto now = std::chrono::steady_clock::now();
        const auto pause = terminal_ ? std::chrono::milliseconds(100) : std::chrono::milliseconds(5000);
        if (shown_ && !last && now - last_shown_ < pause) return;
        last_shown_ = now;
        shown_ = true;
        std::fprintf(stderr, terminal_ ? "\r\033[K%s%s" : "%s%s", progress_line(label_, event).c_str(),
                     terminal_ && !last ? "" : "\n");
        std::fflush(stderr);
    }

    std::string label_;
    bool terminal_;
    bool shown_ = false;
    std::chrono::steady_clock::time_point last_shown_{};
};

void print_line(const Json& event) {
    const std::string text = event.dump(-1, ' ', false, Json::error_handler_t::replace);
    std::fwrite((text + "\n").c_str(), 1, text.size() + 1, stdout);
    std::fflush(stdout);
}

void print_error(const CommonOptions& common, const std::string& kind, const std::string& message) {
    std::string line = message;
    std::replace(line.begin(), line.end(), '\n', ' ');
    std::fprintf(stderr, "fieldgraft: %s\n", line.c_str());
    if (common.json) print_line({{"event", "error"}, {"kind", kind}, {"message", line}});
}

}  // namespace

CLI::App* Program::command(const std::string& name, const std::string& description) {
    CLI::App* app = cli.add_subcommand(name, description);
    app->add_flag("--json", common.json, "print one JSON object a line");
    app->add_flag("--quiet", common.quiet, "no progress");
    app->add_option("--threads", common.threads, "threads (default: every core)")->check(CLI::Range(1, 1024));
    app->add_option("--device", common.device, "cpu or cuda")->check(CLI::IsMember({"cpu", "cuda"}));
    app->add_option("--seed", common.seed, "seed of every random choice");
    return app;
}

Reporter console_reporter(const CommonOptions& common, const std::string& label) {
    std::signal(SIGINT, on_interrupt);
    std::signal(SIGTERM, on_interrupt);
    if (common.json) return Reporter(print_line, &stop_requested);
    if (common.quiet) return Reporter({}, &stop_requested);
    auto people = std::make_shared<People>(label);
    return Reporter([people](const Json& event) { people->show(event); }, &stop_requested);
}

void print_done(const CommonOptions& common, Json figures) {
    figures["event"] = "done";
    if (!figures.contains("peak_mib")) figures["peak_mib"] = peak_mib();
    if (common.json) return print_line(figures);
    for (const auto& [key, value] : figures.items())
        if (key != "event" && !value.is_structured()) std::printf("%-28s %s\n", key.c_str(), number(value).c_str());
    std::fflush(stdout);
}

void apply_common(const CommonOptions& common) {
    const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    at::set_num_threads(common.threads > 0 ? common.threads : cores);
    at::globalContext().setBenchmarkCuDNN(false);
    if (common.device == "cuda" && !at::hasCUDA())
        input_error("--device cuda: this build of libtorch sees no CUDA device; use --device cpu");
    if (common.device == "cuda")
        input_error("--device cuda: this version trains and renders on the CPU; use --device cpu");
}

int run_and_report(const CommonOptions& common, const std::function<void()>& action) {
    try {
        apply_common(common);
        action();
        return 0;
    } catch (const InputError& error) {
        print_error(common, "input", error.what());
        return 2;
    } catch (const Cancelled&) {
        print_error(common, "cancelled", "cancelled; what was finished is saved, --resume goes on from there");
        return 130;
    } catch (const c10::Error& error) {
        print_error(common, "failure", error.what_without_backtrace());
        return 1;
    } catch (const std::exception& error) {
        print_error(common, "failure", error.what());
        return 1;
    }
}

}  // namespace fieldgraft::app
