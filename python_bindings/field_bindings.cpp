// fieldgraft.Field and fieldgraft.Edit: files as objects. What they hold is made by train() and edit().
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/base/errors.h"
#include "core/field/edit_field.h"
#include "core/field/radiance_field.h"
#include "python_bindings/arrays.h"
#include "python_bindings/bindings.h"
#include "python_bindings/reporting.h"

namespace py = pybind11;

namespace fieldgraft {
namespace {

// A strength as a property: in [0, 1], and only of an operation that the edit has.
void bind_strength(py::class_<EditFile, std::shared_ptr<EditFile>>& type, const char* name, float EditFile::*member,
                   bool Operations::*operation) {
    type.def_property(
        name, [member](const EditFile& self) { return self.*member; },
        [name, member, operation](EditFile& self, float value) {
            if (!(value >= 0 && value <= 1)) input_error("{}: {} is not a strength from 0 to 1", name, value);
            if (!(self.field->config().operations.*operation))
                input_error("{}: this edit has only {}", name, self.field->config().operations.to_string());
            self.*member = value;
        });
}

}  // namespace

void bind_field(py::module_& m) {
    py::class_<RadianceField, std::shared_ptr<RadianceField>>(m, "Field")
        .def_static("load", &RadianceField::load, py::arg("path"))
        .def(
            "save", [](const RadianceField& self, const std::filesystem::path& path) { self.save(path); },
            py::arg("path"))
        .def("hash", &RadianceField::hash, "SHA-256 over tensors and geometry; edits name their field by it.")
        .def_property_readonly("geometry",
                               [](const RadianceField& self) { return to_python(self.geometry().to_json()); });

    py::class_<EditFile, std::shared_ptr<EditFile>> edit(m, "Edit");
    edit.def_static(
            "load", [](const std::filesystem::path& path) { return std::make_shared<EditFile>(EditFile::load(path)); },
            py::arg("path"))
        .def("save", &EditFile::save, py::arg("path"))
        .def("hash", &EditFile::hash)
        .def_readonly("field_hash", &EditFile::field_hash, "the hash of the field it was made for")
        .def_property_readonly("operations",
                               [](const EditFile& self) { return self.field->config().operations.to_string(); })
        .def_property_readonly("specification", [](const EditFile& self) { return to_python(self.specification); });
    bind_strength(edit, "strength_add", &EditFile::strength_add, &Operations::add);
    bind_strength(edit, "strength_remove", &EditFile::strength_remove, &Operations::remove);
    bind_strength(edit, "strength_change", &EditFile::strength_change, &Operations::change);
}

}  // namespace fieldgraft
