// The frame after the one that is rendered, as the motion plane needs it.
#pragma once

#include "backend/batch/output.h"
#include "backend/render/motion.h"
#include "backend/scene/animator.h"

namespace octrace::batch {

// Refers to `next`, which must live while the view is rendered.
render::NextFrame next_frame(const scene::Scene& scene, const scene::Camera& camera,
                             const scene::Moment& next, const ImageSize& size);

}  // namespace octrace::batch
