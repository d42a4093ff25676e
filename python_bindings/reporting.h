// Events of long work for a Python callback, and the way back: the callback returns False, raises, or the user presses
// Ctrl-C, and the work stops as soon as it has saved what it can.
#pragma once

#include <pybind11/pybind11.h>

#include <atomic>
#include <exception>

#include "core/base/errors.h"
#include "core/base/progress.h"

namespace fieldgraft {

inline pybind11::object to_python(const Json& json) {
    return pybind11::module_::import("json").attr("loads")(json.dump());
}

inline Json from_python(const pybind11::object& object) {
    return Json::parse(pybind11::module_::import("json").attr("dumps")(object).cast<std::string>());
}

// Runs `work(reporter)` without the interpreter's lock.
template <class Work>
auto run_reporting(const pybind11::object& callback, Work&& work) {
    std::atomic<bool> stop = false;
    std::exception_ptr raised;
    const Reporter reporter(
        [&](const Json& event) {
            const pybind11::gil_scoped_acquire lock;
            if (raised) return;
            try {
                if (PyErr_CheckSignals() != 0) throw pybind11::error_already_set();
                if (callback.is_none()) return;
                const pybind11::object answer = callback(to_python(event));
                if (answer.is(pybind11::bool_(false))) stop = true;
            } catch (pybind11::error_already_set&) {
                raised = std::current_exception();
                stop = true;
            }
        },
        &stop);
    try {
        const pybind11::gil_scoped_release release;
        return work(reporter);
    } catch (const Cancelled&) {
        if (raised) std::rethrow_exception(raised);
        throw;
    }
}

}  // namespace fieldgraft
