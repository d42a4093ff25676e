// A field under a stack of edits, as density and view-independent colour at points: what a bake samples.
//
// The stack is evaluated level by level as the renderer does (core/render/medium.h), over diffuse_color() of the field;
// f's density is 0 outside its occupied cells, where the renderer does not march either. Cells to look at: the field's,
// and the supports of edits that add; the whole box where one of these is unknown. The field and the edits must outlive
// the source. Throws std::invalid_argument as check_stack does.
#pragma once

#include "core/field/radiance_field.h"
#include "core/render/medium.h"
#include "vdb_export/sampling.h"

namespace fieldgraft {

VolumeSource volume_source(const RadianceField& field, const EditStack& stack);

}  // namespace fieldgraft
