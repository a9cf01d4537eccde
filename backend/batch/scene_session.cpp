#include "backend/batch/scene_session.h"

#include <fmt/format.h>

#include "backend/gltf/document.h"
#include "backend/image/image.h"
#include "backend/scene/builtin.h"
#include "backend/scene/flatten.h"
#include "backend/util/log.h"
#include "backend/util/process.h"

namespace octrace::batch {

namespace {

util::Result<scene::DecodedImage> decode_image(std::span<const std::uint8_t> bytes,
                                               const std::string& mime,
                                               const util::Limits& limits) {
  util::Result<image::Rgba8> decoded = image::decode(bytes, mime, limits);
  if (!decoded) return decoded.error();
  return scene::DecodedImage{decoded->width, decoded->height, std::move(decoded->texels)};
}

util::Result<scene::DecodedImage> white_image(std::span<const std::uint8_t>, const std::string&,
                                              const util::Limits&) {
  return scene::DecodedImage{1, 1, {0xffffffffu}};
}

util::Result<void> load_builtin(const SceneRequest& request, SceneSession& session) {
  const std::string name = request.source.substr(scene::kBuiltinPrefix.size());
  if (request.scene.value_or(0) != 0) {
    return util::Error{
        util::Exit::usage, "",
        fmt::format("--scene {}: {} has one scene, 0", *request.scene, request.source), "", ""};
  }
  if (!request.variant.empty()) {
    return util::Error{
        util::Exit::usage, "",
        fmt::format("--variant {}: {} has no variants", request.variant, request.source), "", ""};
  }
  util::Result<scene::Scene> made = scene::make_builtin(name, request.limits);
  if (!made) return made.error();
  session.scene = std::move(*made);
  if (request.collect_info) session.info = scene::collect_info(name, session.scene);
  return {};
}

util::Result<void> load_animated(const SceneRequest& request, const scene::FlattenOptions& options,
                                 gltf::Document& document, SceneSession& session) {
  // The report on the document comes after flattening, so that it needs a copy here.
  auto animator = scene::Animator::open(request.collect_info ? document : std::move(document),
                                        options, request.animation, request.time, session.scene);
  if (!animator) return animator.error();
  if (request.collect_info) session.info = scene::collect_info(document, session.scene);
  if (request.moving && (*animator)->moves()) session.animator = std::move(*animator);
  return {};
}

util::Result<void> load_file(const SceneRequest& request, SceneSession& session) {
  util::Result<gltf::Document> document =
      gltf::load(request.source, {request.limits, request.missing_images_warn});
  if (!document) return document.error();
  for (const std::string& warning : document->warnings) util::log_warning(warning);
  scene::FlattenOptions options;
  options.scene = request.scene;
  options.variant = request.variant;
  options.need_textures = request.need_textures;
  options.missing_images_warn = request.missing_images_warn;
  options.limits = request.limits;
  options.decode = request.decode_images ? decode_image : white_image;
  if (request.time || request.moving) return load_animated(request, options, *document, session);
  util::Result<scene::Scene> flattened = scene::flatten(*document, options);
  if (!flattened) return flattened.error();
  session.scene = std::move(*flattened);
  if (request.collect_info) session.info = scene::collect_info(*document, session.scene);
  return {};
}

}  // namespace

util::Result<std::unique_ptr<SceneSession>> open_scene(const SceneRequest& request) {
  auto session = std::make_unique<SceneSession>();
  session->source = request.source;
  const util::Timer load_timer;
  util::Result<void> loaded = request.source.starts_with(scene::kBuiltinPrefix)
                                  ? load_builtin(request, *session)
                                  : load_file(request, *session);
  if (!loaded) return loaded.error();
  session->load_ms = load_timer.milliseconds();
  for (const std::string& warning : session->scene.warnings) util::log_warning(warning);
  util::log_verbose(fmt::format("{}: {} triangles, loaded in {:.1f} ms", request.source,
                                session->scene.triangles.size(), session->load_ms));

  octree::BuildOptions& build = session->build;
  build = request.build;
  build.max_bytes = request.limits.max_scene_bytes;
  build.cuts = !(request.refits && session->animator);  // of no use in trees that are refitted
  const util::Timer build_timer;
  util::Result<octree::Octree> octree = octree::build(session->scene, build);
  if (!octree) return octree.error();
  session->octree = std::move(*octree);
  session->build_ms = build_timer.milliseconds();
  util::log_verbose(fmt::format("octree: {} nodes, built in {:.1f} ms",
                                session->octree.nodes.size(), session->build_ms));

  if (request.verify) {
    const util::Timer verify_timer;
    util::Result<void> verified = octree::verify(session->octree, session->scene);
    if (!verified) return verified.error();
    session->verify_ms = verify_timer.milliseconds();
    util::log_verbose(fmt::format("octree: verified in {:.1f} ms", session->verify_ms));
  }
  return session;
}

util::Result<scene::SceneChanges> SceneSession::move_to(scene::Time time) {
  if (!animator) return scene::SceneChanges{};
  auto changes = animator->move_to(time, scene);
  if (!changes || !changes->geometry()) return changes;
  auto updated = octree::update(scene, build, {}, octree, upkeep);
  if (!updated) return updated.error();
  return changes;
}

util::Result<scene::Moment> SceneSession::at(scene::Time time) const {
  return animator ? animator->at(time, scene) : util::Result<scene::Moment>(scene::Moment());
}

}  // namespace octrace::batch
