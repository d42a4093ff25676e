// What module.cpp calls: each room's bindings, one function and one file a room.
#pragma once

#include <pybind11/pybind11.h>

namespace fieldgraft {

void bind_guidance(pybind11::module_& m);
void bind_blend(pybind11::module_& m);
void bind_scene(pybind11::module_& m);
void bind_field(pybind11::module_& m);
void bind_train(pybind11::module_& m);
void bind_edit(pybind11::module_& m);
void bind_render(pybind11::module_& m);
void bind_bake(pybind11::module_& m);

}  // namespace fieldgraft
