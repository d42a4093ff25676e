// The compiled half of the Python package: one function a room, no logic. Errors: InputError becomes
// fieldgraft.InputError (a ValueError), Failure fieldgraft.Failure (a RuntimeError), Cancelled fieldgraft.Cancelled.
#include <pybind11/pybind11.h>

#include "core/base/errors.h"
#include "python_bindings/bindings.h"

PYBIND11_MODULE(_core, m) {
    m.doc() = "Fieldgraft's engine";
    pybind11::register_exception<fieldgraft::InputError>(m, "InputError", PyExc_ValueError);
    pybind11::register_exception<fieldgraft::Failure>(m, "Failure", PyExc_RuntimeError);
    pybind11::register_exception<fieldgraft::Cancelled>(m, "Cancelled", PyExc_RuntimeError);
    fieldgraft::bind_guidance(m);
    fieldgraft::bind_blend(m);
    fieldgraft::bind_scene(m);
    fieldgraft::bind_field(m);
    fieldgraft::bind_train(m);
    fieldgraft::bind_edit(m);
    fieldgraft::bind_render(m);
    fieldgraft::bind_bake(m);
}
