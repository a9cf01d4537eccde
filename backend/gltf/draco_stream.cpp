#include "backend/gltf/draco_stream.h"

#include <draco/compression/config/decoder_options.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/decoder_buffer.h>
#include <draco/core/varint_decoding.h>
#include <draco/mesh/mesh.h>
#include <fmt/format.h>

#include <optional>
#include <string>
#include <utility>

#include "backend/gltf/draco_attributes.h"
#include "backend/util/checked.h"

namespace octrace::gltf {
namespace {

using util::Error;
using util::Exit;

Error invalid(std::string message) {
  return {Exit::invalid_input, "DRACO_DATA_INVALID", std::move(message), "", ""};
}

// More of either than any accessor can use.
constexpr int kMaxAttributes = 64;
constexpr int kMaxComponents = 16;

// The counts at the head of the connectivity; libdraco allocates by them before it reads on.
std::optional<Error> check_counts(std::uint64_t faces, std::uint64_t points, std::uint64_t bytes,
                                  const DracoBounds& bounds) {
  if (faces > bounds.max_faces) {
    return invalid(fmt::format("holds {} faces, the indices make {}", faces, bounds.max_faces));
  }
  if (points > bounds.max_points) {
    return invalid(
        fmt::format("holds {} points, the accessors have {}", points, bounds.max_points));
  }
  if (faces / kDracoFacesPerByte > bytes || points / (3 * kDracoFacesPerByte) > bytes) {
    return invalid(
        fmt::format("{} bytes cannot hold {} faces and {} points", bytes, faces, points));
  }
  return std::nullopt;
}

std::optional<Error> check_attributes(const draco::PointCloud& cloud, const DracoBounds& bounds) {
  if (cloud.num_attributes() > kMaxAttributes) {
    return invalid(fmt::format("holds {} attributes, {} are the most that are read",
                               cloud.num_attributes(), kMaxAttributes));
  }
  std::uint64_t entry = 0;
  for (int i = 0; i < cloud.num_attributes(); ++i) {
    const draco::PointAttribute* attribute = cloud.attribute(i);
    if (attribute->num_components() < 1 || attribute->num_components() > kMaxComponents) {
      return invalid(fmt::format("attribute {} has {} components", i,
                                 static_cast<int>(attribute->num_components())));
    }
    entry += static_cast<std::uint64_t>(attribute->byte_stride());
  }
  const auto bytes = util::checked_mul(entry, cloud.num_points());
  if (!bytes || *bytes > bounds.max_bytes) {
    return Error{Exit::limit, "LIMIT",
                 fmt::format("decodes to {} bytes, --max-scene-bytes allows {}",
                             bytes.value_or(UINT64_MAX), bounds.max_bytes),
                 "", ""};
  }
  return std::nullopt;
}

// libdraco's own decoders, stopped where memory or time is about to be taken for more than is
// allowed.
template <class Base>
class Bounded : public Base {
 public:
  Bounded(const DracoBounds& bounds, std::uint64_t bytes) : bounds_(bounds), bytes_(bytes) {}
  const std::optional<Error>& error() const { return error_; }

 protected:
  bool DecodeConnectivity() override {
    draco::DecoderBuffer ahead = *this->buffer();  // a view with a position
    std::uint32_t first = 0, second = 0;
    const bool read = draco::DecodeVarint(&first, &ahead) && draco::DecodeVarint(&second, &ahead);
    constexpr bool kSequential = std::is_same_v<Base, draco::MeshSequentialDecoder>;
    const std::uint64_t faces = kSequential ? first : second;
    const std::uint64_t points = kSequential ? second : first;
    if (read) error_ = check_counts(faces, points, bytes_, bounds_);
    if constexpr (!kSequential) {
      // One corner table for each of these.
      std::uint8_t attribute_data = 0;
      if (read && ahead.Decode(&attribute_data) && attribute_data > kMaxAttributes && !error_) {
        error_ = invalid(fmt::format("holds {} attribute connectivities", attribute_data));
      }
    }
    return read && !error_ && Base::DecodeConnectivity();
  }

  bool CreateAttributesDecoder(std::int32_t group) override {
    return Base::CreateAttributesDecoder(group) && bound_attributes(*this, group, error_);
  }

  bool DecodeAllAttributes() override {
    // Seams split points while the connectivity is read.
    error_ = check_counts(this->mesh()->num_faces(), this->mesh()->num_points(), bytes_, bounds_);
    if (!error_) error_ = check_attributes(*this->point_cloud(), bounds_);
    return !error_ && Base::DecodeAllAttributes();
  }

 private:
  DracoBounds bounds_;
  std::uint64_t bytes_;
  std::optional<Error> error_;
};

template <class Decoder>
util::Result<DracoMesh> decode(std::span<const std::uint8_t> bytes, const DracoBounds& bounds) {
  DracoMesh mesh(new draco::Mesh);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  Bounded<Decoder> decoder(bounds, bytes.size());
  const draco::Status status = decoder.Decode(draco::DecoderOptions(), &buffer, mesh.get());
  if (decoder.error()) return *decoder.error();
  if (!status.ok()) {
    return invalid(fmt::format("{} bytes do not decode: {}", bytes.size(), status.error_msg()));
  }
  return mesh;
}

}  // namespace

void DracoMeshDeleter::operator()(draco::Mesh* mesh) const { delete mesh; }

util::Result<DracoMesh> decode_draco_stream(std::span<const std::uint8_t> bytes,
                                            const DracoBounds& bounds) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  draco::DracoHeader header;
  const draco::Status status = draco::PointCloudDecoder::DecodeHeader(&buffer, &header);
  if (!status.ok()) return invalid(fmt::format("no header: {}", status.error_msg()));
  if (header.version_major != 2 || header.version_minor != 2) {
    return Error{
        Exit::unsupported, "DRACO_VERSION",
        fmt::format("bitstream {}.{}, the extension is of 2.2",
                    static_cast<int>(header.version_major), static_cast<int>(header.version_minor)),
        "", ""};
  }
  if (header.encoder_type != draco::TRIANGULAR_MESH) {
    return invalid("holds a point cloud, needs a mesh");
  }
  if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING) {
    return decode<draco::MeshSequentialDecoder>(bytes, bounds);
  }
  if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING) {
    return decode<draco::MeshEdgebreakerDecoder>(bytes, bounds);
  }
  return invalid(fmt::format("encoding method {}", static_cast<int>(header.encoder_method)));
}

}  // namespace octrace::gltf
