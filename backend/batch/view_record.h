// What a journal's lines keep of scenes and views so that cameras.json, objects.json and
// annotations.json can be written from journals alone (docs/batch.md, "Journal lines").
#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "backend/batch/view_objects.h"
#include "backend/scene/camera.h"
#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::batch {

// The member `objects` of a `view` line: [{"id", "pixels", "box", "rle"}], by id.
nlohmann::ordered_json objects_record(std::span<const ViewObject> objects);

// The member `objects` of a `scene` line: [{"id", "name", "mesh", "materials"}] of the objects that
// have geometry, by id, as in the object_id plane.
nlohmann::ordered_json scene_objects_record(const scene::Scene& scene);

// The camera of a `view` line's `lens`; exit 3 where it is none.
util::Result<scene::Camera> camera_of_record(const nlohmann::ordered_json& lens);

}  // namespace octrace::batch
