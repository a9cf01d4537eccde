#include <fmt/format.h>

#include <iterator>

#include "backend/image/image.h"
#include "exporters/povray/parts.h"

namespace octrace::exporters::povray {

namespace {

// The index of a texel brought into [0, size), as glTF's samplers do; i is an integer.
std::string wrapped(const char* i, std::uint32_t size, kernels::Wrap wrap) {
  switch (wrap) {
    case kernels::Wrap::repeat:
      return fmt::format("{0}-{1}*floor({0}/{1})", i, size);
    case kernels::Wrap::mirror: {
      const std::string m = fmt::format("({0}-{1}*floor({0}/{1}))", i, 2 * std::uint64_t{size});
      return fmt::format("min({0},{1}-{0})", m, 2 * std::uint64_t{size} - 1);
    }
    case kernels::Wrap::clamp:
      break;
  }
  return fmt::format("min(max({},0),{})", i, size - 1);
}

// AlphaN(u, v): texture N's alpha, filtered as glTF says. POV-Ray's own interpolation places texels
// elsewhere, so the map is read without it, at texel centres only.
util::Result<void> append_alpha_function(std::string& out, Job& job, std::uint32_t index) {
  const kernels::Texture& texture = job.scene.textures[index];
  const std::uint64_t count = std::uint64_t{texture.width} * texture.height;
  // In 16 bits: of the 256 values of an 8-bit map, POV-Ray 3.7 reads 84 as one less.
  std::vector<std::uint32_t> alpha(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    alpha[i] = (job.scene.texels[texture.first_texel + i] >> 24) * 257;
  }
  const std::string file = fmt::format("{}_alpha_{}.png", job.path.safe_stem, index);
  const std::string path = job.path.folder + file;
  image::ImageView view;
  view.width = texture.width;
  view.height = texture.height;
  view.channels.push_back({"Y", image::SampleType::uint32, alpha.data(), sizeof(std::uint32_t)});
  view.metadata.emplace_back("oiio:ColorSpace", "");  // a gamma would be applied
  auto written = image::write_integer(path, view, image::Encoding::index16, 1.0);
  if (!written) return written.error();
  job.result.written.push_back(path);

  auto to = std::back_inserter(out);
  fmt::format_to(
      to,
      "\n#declare AlphaMap{0} = function {{ pigment {{ image_map {{ png \"{1}\" gamma 1.0 "
      "}} }} }}\n",
      index, file);
  fmt::format_to(to,
                 "#declare AlphaTexel{0} = function(i,j) {{ "
                 "AlphaMap{0}(({1}+0.5)/{2},1-({3}+0.5)/{4},0).red }}\n",
                 index, wrapped("i", texture.width, texture.wrap_s), texture.width,
                 wrapped("j", texture.height, texture.wrap_t), texture.height);
  if (texture.filter == kernels::Filter::nearest) {
    fmt::format_to(to,
                   "#declare Alpha{0} = function(u,v) {{ AlphaTexel{0}(floor(u*{1}),floor(v*{2})) "
                   "}}\n",
                   index, texture.width, texture.height);
  } else {
    fmt::format_to(to,
                   "#declare AlphaLerp{0} = function(i,j,f,g) {{\n"
                   "  (AlphaTexel{0}(i,j)*(1-f)+AlphaTexel{0}(i+1,j)*f)*(1-g)\n"
                   "  +(AlphaTexel{0}(i,j+1)*(1-f)+AlphaTexel{0}(i+1,j+1)*f)*g }}\n"
                   "#declare Alpha{0} = function(u,v) {{ AlphaLerp{0}(floor(u*{1}-0.5),"
                   "floor(v*{2}-0.5),u*{1}-0.5-floor(u*{1}-0.5),v*{2}-0.5-floor(v*{2}-0.5)) }}\n",
                   index, texture.width, texture.height);
  }
  return {};
}

}  // namespace

bool is_cut(const Job& job, const kernels::Material& material) {
  return job.options.alpha && material.alpha_mode == kernels::AlphaMode::mask;
}

util::Result<void> append_cut_functions(std::string& out, Job& job) {
  std::vector<bool> used(job.scene.materials.size(), false);
  for (const kernels::Geometry& geometry : job.scene.geometries) used[geometry.material] = true;
  std::vector<bool> mapped(job.scene.textures.size(), false);
  for (std::size_t i = 0; i < job.scene.materials.size(); ++i) {
    const kernels::Material& material = job.scene.materials[i];
    if (!used[i] || !is_cut(job, material)) continue;
    const std::uint32_t texture = material.base_color_texture.texture;
    std::string alpha = fmt::format("{:.9g}*w", material.base_color.w);
    if (texture != kernels::kNone) {
      if (!mapped[texture]) {
        mapped[texture] = true;
        if (auto written = append_alpha_function(out, job, texture); !written) return written;
      }
      alpha += fmt::format("*Alpha{}(u,v)", texture);
    }
    fmt::format_to(std::back_inserter(out),
                   "#declare Cut{} = function(u,v,w) {{ "
                   "select(min(max({},0),1)-({:.9g}),0.25,0.75) }}\n",
                   i, alpha, material.alpha_cutoff);
  }
  return {};
}

}  // namespace octrace::exporters::povray
