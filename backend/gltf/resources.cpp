#include "backend/gltf/resources.h"

#include <fmt/format.h>

#include "backend/gltf/image_header.h"
#include "backend/gltf/uri.h"
#include "backend/util/checked.h"

namespace octrace::gltf {
namespace {

using Bytes = std::vector<std::uint8_t>;

// Adds what is about to be read; false after reporting that it is too much. Files may be named
// many times, so a limit for each of them is not enough.
class Budget {
 public:
  Budget(const util::Limits& limits, Issues& issues) : limits_(limits), issues_(issues) {}
  bool add(std::uint64_t bytes, const std::string& pointer) {
    const auto sum = util::checked_add(used_, bytes);
    if (sum && *sum <= limits_.max_scene_bytes) {
      used_ = *sum;
      return true;
    }
    issues_.fail(util::Exit::limit, "LIMIT", pointer,
                 fmt::format("{} more bytes beside {}, --max-scene-bytes allows {}", bytes, used_,
                             limits_.max_scene_bytes));
    return false;
  }

 private:
  const util::Limits& limits_;
  Issues& issues_;
  std::uint64_t used_ = 0;
};

// The error gets `pointer`; a data URI's media type goes to `mime`.
util::Result<Bytes> read_uri(const std::string& uri, const SceneFolder& folder,
                             std::uint64_t max_bytes, std::uint64_t wanted, std::string& mime) {
  if (is_data_uri(uri)) {
    auto data = decode_data_uri(uri);
    if (!data) return std::move(data.error());
    mime = std::move(data->mime);
    return std::move(data->bytes);
  }
  const auto path = relative_path(uri);
  if (!path) return path.error();
  return folder.read(*path, max_bytes, wanted);
}

void report(const util::Error& error, const std::string& pointer, Issues& issues) {
  issues.fail(error.exit, error.code, pointer, error.message);
}

// Whether a buffer's bytes are read; `replaced`: only views name it whose compressed form is read
// instead, from another buffer, so that its own bytes need not even be there.
enum class Need { none, read, replaced };

std::vector<Need> buffer_needs(const Structure& structure) {
  const auto& views = structure.model.bufferViews;
  std::vector<Need> needs(structure.buffers.size(), Need::none);
  for (std::size_t i = 0; i < needs.size(); ++i) {
    if (structure.fallback_buffers[i]) needs[i] = Need::replaced;
  }
  std::vector<bool> compressed(views.size());
  for (const MeshoptView& view : structure.meshopt) {
    compressed[view.view] = true;
    needs[view.buffer] = Need::read;
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    Need& need = needs[static_cast<std::size_t>(views[i].buffer)];
    if (!compressed[i]) {
      need = Need::read;
    } else if (need == Need::none) {
      need = Need::replaced;
    }
  }
  return needs;
}

void load_buffer(Structure& structure, std::size_t i, bool has_views, std::optional<Bytes>& bin,
                 const SceneFolder& folder, const util::Limits& limits, Issues& issues) {
  const Source& source = structure.buffers[i];
  const std::string pointer = fmt::format("/buffers/{}", i);
  Bytes data;
  if (!source.uri.empty()) {
    std::string mime;
    auto read = read_uri(source.uri, folder, limits.max_file_bytes, source.byte_length, mime);
    if (!read) return report(read.error(), pointer + "/uri", issues);
    if (!mime.empty() && mime != "application/octet-stream" && mime != "application/gltf-buffer") {
      issues.warn("BUFFER_DATA_URI_MIME_TYPE_INVALID", pointer + "/uri",
                  fmt::format("{} is read as bytes", quote(mime)));
    }
    data = std::move(*read);
  } else if (i == 0 && bin) {
    data = std::move(*bin);
    if (data.size() > source.byte_length + 3) {
      issues.warn("BUFFER_GLB_CHUNK_TOO_BIG", pointer,
                  fmt::format("the BIN chunk has {} bytes more than the buffer",
                              data.size() - source.byte_length));
    }
  } else if (has_views) {
    issues.invalid("BUFFER_MISSING_GLB_DATA", pointer,
                   "has neither a uri nor the BIN chunk of a GLB behind it");
    return;
  } else {
    return;  // a placeholder that nothing reads
  }
  if (data.size() < source.byte_length) {
    issues.invalid("BUFFER_BYTE_LENGTH_MISMATCH", pointer,
                   fmt::format("needs {} bytes, has {}", source.byte_length, data.size()));
    return;
  }
  data.resize(source.byte_length);
  structure.model.buffers[i].data = std::move(data);
}

// What a texture shows: an image that octrace decodes, one for an extension it does not have (which
// may be of any format), or nothing.
enum class Use { none, decoded, foreign };

std::vector<Use> image_uses(const tinygltf::Model& model) {
  std::vector<Use> uses(model.images.size(), Use::none);
  const auto mark = [&](int image, Use use) {
    if (image >= 0 && uses[static_cast<std::size_t>(image)] != Use::decoded) {
      uses[static_cast<std::size_t>(image)] = use;
    }
  };
  for (const auto& texture : model.textures) {
    mark(texture.source, Use::decoded);
    for (const auto& [name, value] : texture.extensions) {
      if (!value.Has("source") || !value.Get("source").IsInt()) continue;
      mark(value.Get("source").GetNumberAsInt(),
           name == "EXT_texture_webp" ? Use::decoded : Use::foreign);
    }
  }
  return uses;
}

util::Result<EncodedImage> load_image(const Structure& structure, std::size_t i,
                                      const SceneFolder& folder, const util::Limits& limits,
                                      Budget& budget, Issues& issues) {
  const auto& image = structure.model.images[i];
  const Source& source = structure.images[i];
  EncodedImage encoded;
  encoded.pointer = fmt::format("/images/{}", i);
  encoded.uri = image.uri;
  std::string declared = image.mimeType;
  if (image.bufferView >= 0) {
    const auto& view = structure.model.bufferViews[static_cast<std::size_t>(image.bufferView)];
    if (!budget.add(view.byteLength, encoded.pointer)) return encoded;
    const auto& data = structure.model.buffers[static_cast<std::size_t>(view.buffer)].data;
    const auto begin = data.begin() + static_cast<std::ptrdiff_t>(view.byteOffset);
    encoded.bytes.assign(begin, begin + static_cast<std::ptrdiff_t>(view.byteLength));
  } else {
    std::string mime;
    auto read = read_uri(source.uri, folder, limits.max_file_bytes, UINT64_MAX, mime);
    if (!read) {
      read.error().pointer = encoded.pointer + "/uri";
      return std::move(read.error());
    }
    if (!budget.add(read->size(), encoded.pointer)) return encoded;
    encoded.bytes = std::move(*read);
    if (declared.empty()) declared = mime;
  }
  const auto header = read_image_header(encoded.bytes);
  if (!header) {
    util::Error error = header.error();
    error.pointer = encoded.pointer;
    return error;
  }
  encoded.mime = header->mime;
  if (!declared.empty() && declared != encoded.mime) {
    issues.warn("IMAGE_MIME_TYPE_INVALID", encoded.pointer,
                fmt::format("declared as {}, is {}", quote(declared), encoded.mime));
  }
  const std::uint64_t pixels = std::uint64_t{header->width} * header->height;
  if (pixels > limits.max_texture_pixels) {
    return util::Error{
        util::Exit::limit, "LIMIT",
        fmt::format("{} x {} are {} pixels, --max-texture-pixels allows {}", header->width,
                    header->height, pixels, limits.max_texture_pixels),
        "", encoded.pointer};
  }
  return encoded;
}

}  // namespace

void load_buffers(Structure& structure, std::optional<Bytes> bin, const SceneFolder& folder,
                  const util::Limits& limits, Issues& issues) {
  Budget budget(limits, issues);
  const std::vector<Need> needs = buffer_needs(structure);
  for (std::size_t i = 0; i < structure.buffers.size() && !issues.failed(); ++i) {
    if (needs[i] == Need::replaced) {
      structure.buffers[i].uri = {};
      continue;
    }
    if (!budget.add(structure.buffers[i].byte_length, fmt::format("/buffers/{}", i))) return;
    load_buffer(structure, i, needs[i] == Need::read, bin, folder, limits, issues);
    structure.buffers[i].uri = {};  // a data URI is as large as its bytes
  }
}

std::vector<EncodedImage> load_images(const Structure& structure, const SceneFolder& folder,
                                      const LoadOptions& options, Issues& issues) {
  std::vector<EncodedImage> images;
  Budget budget(options.limits, issues);
  const std::vector<Use> uses = image_uses(structure.model);
  for (std::size_t i = 0; i < structure.images.size() && !issues.failed(); ++i) {
    auto image = load_image(structure, i, folder, options.limits, budget, issues);
    if (image) {
      images.push_back(std::move(*image));
      continue;
    }
    const util::Error& error = image.error();
    // Only the picture may be missing: a reference that leaves the folder stays an error.
    const bool is_picture = error.exit == util::Exit::io || error.code.starts_with("IMAGE_");
    if (is_picture && (options.missing_images_warn || uses[i] == Use::foreign)) {
      issues.warn(error.code, error.pointer, error.message + "; rendered without it");
      EncodedImage missing;
      missing.pointer = fmt::format("/images/{}", i);
      missing.uri = structure.model.images[i].uri;
      images.push_back(std::move(missing));
    } else {
      report(error, error.pointer, issues);
    }
  }
  return images;
}

}  // namespace octrace::gltf
