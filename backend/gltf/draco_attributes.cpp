#include "backend/gltf/draco_attributes.h"

#include <draco/compression/attributes/sequential_attribute_decoders_controller.h>
#include <draco/compression/attributes/sequential_integer_attribute_decoder.h>
#include <draco/compression/attributes/sequential_quantization_attribute_decoder.h>
#include <draco/compression/mesh/mesh_decoder.h>
#include <draco/core/varint_decoding.h>
#include <draco/mesh/mesh.h>
#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <utility>

namespace octrace::gltf {
namespace {

using Scheme = draco::PredictionSchemeTypedDecoderInterface<std::int32_t>;
using ErrorPlace = std::optional<util::Error>;

// A prediction of texture coordinates begins with its number of orientations, by which libdraco
// takes memory and time: 2^31 of them took 256 MB and seconds, for a stream of a few bytes. A
// corner has at most one.
class BoundedScheme : public Scheme {
 public:
  BoundedScheme(std::unique_ptr<Scheme> scheme, std::uint64_t corners, ErrorPlace& error)
      : scheme_(std::move(scheme)), corners_(corners), error_(error) {}

  bool DecodePredictionData(draco::DecoderBuffer* buffer) override {
    draco::DecoderBuffer ahead = *buffer;  // a view with a position
    std::uint32_t orientations = 0;
    const bool read = GetPredictionMethod() == draco::MESH_PREDICTION_TEX_COORDS_PORTABLE
                          ? ahead.Decode(&orientations)
                          : draco::DecodeVarint(&orientations, &ahead);
    if (!read) return false;
    if (orientations > corners_) {
      error_ = util::Error{
          util::Exit::invalid_input, "DRACO_DATA_INVALID",
          fmt::format("holds {} orientations of texture coordinates, the mesh has {} corners",
                      orientations, corners_),
          "", ""};
      return false;
    }
    return scheme_->DecodePredictionData(buffer);
  }

  bool ComputeOriginalValues(const std::int32_t* corrections, std::int32_t* values, int size,
                             int components, const draco::PointIndex* points) override {
    return scheme_->ComputeOriginalValues(corrections, values, size, components, points);
  }
  draco::PredictionSchemeMethod GetPredictionMethod() const override {
    return scheme_->GetPredictionMethod();
  }
  const draco::PointAttribute* GetAttribute() const override { return scheme_->GetAttribute(); }
  bool IsInitialized() const override { return scheme_->IsInitialized(); }
  int GetNumParentAttributes() const override { return scheme_->GetNumParentAttributes(); }
  draco::GeometryAttribute::Type GetParentAttributeType(int i) const override {
    return scheme_->GetParentAttributeType(i);
  }
  bool SetParentAttribute(const draco::PointAttribute* attribute) override {
    return scheme_->SetParentAttribute(attribute);
  }
  bool AreCorrectionsPositive() override { return scheme_->AreCorrectionsPositive(); }
  draco::PredictionSchemeTransformType GetTransformType() const override {
    return scheme_->GetTransformType();
  }

 private:
  std::unique_ptr<Scheme> scheme_;
  std::uint64_t corners_;
  ErrorPlace& error_;
};

// libdraco's own decoder of one attribute.
template <class Base>
class BoundedAttribute : public Base {
 public:
  BoundedAttribute(std::uint64_t corners, ErrorPlace& error) : corners_(corners), error_(error) {}

 protected:
  std::unique_ptr<Scheme> CreateIntPredictionScheme(
      draco::PredictionSchemeMethod method,
      draco::PredictionSchemeTransformType transform) override {
    auto scheme = Base::CreateIntPredictionScheme(method, transform);
    // The scheme may be another one than was asked for.
    if (!scheme ||
        (scheme->GetPredictionMethod() != draco::MESH_PREDICTION_TEX_COORDS_PORTABLE &&
         scheme->GetPredictionMethod() != draco::MESH_PREDICTION_TEX_COORDS_DEPRECATED)) {
      return scheme;
    }
    return std::make_unique<BoundedScheme>(std::move(scheme), corners_, error_);
  }

 private:
  std::uint64_t corners_;
  ErrorPlace& error_;
};

// libdraco's own decoder of a group of attributes, which makes those of its attributes.
class BoundedGroup : public draco::SequentialAttributeDecodersController {
 public:
  BoundedGroup(draco::SequentialAttributeDecodersController&& made, const draco::Mesh& mesh,
               ErrorPlace& error)
      : SequentialAttributeDecodersController(std::move(made)), mesh_(mesh), error_(error) {}

 protected:
  std::unique_ptr<draco::SequentialAttributeDecoder> CreateSequentialDecoder(
      std::uint8_t type) override {
    const std::uint64_t corners = std::uint64_t{mesh_.num_faces()} * 3;
    const auto make = [&]<class Base>() {
      return std::make_unique<BoundedAttribute<Base>>(corners, error_);
    };
    switch (type) {
      case draco::SEQUENTIAL_ATTRIBUTE_ENCODER_INTEGER:
        return make.operator()<draco::SequentialIntegerAttributeDecoder>();
      case draco::SEQUENTIAL_ATTRIBUTE_ENCODER_QUANTIZATION:
        return make.operator()<draco::SequentialQuantizationAttributeDecoder>();
      default:  // normals, whose predictions have no such count; none; unknown
        return SequentialAttributeDecodersController::CreateSequentialDecoder(type);
    }
  }

 private:
  const draco::Mesh& mesh_;
  ErrorPlace& error_;
};

}  // namespace

bool bound_attributes(draco::MeshDecoder& decoder, int group, std::optional<util::Error>& error) {
  using Controller = draco::SequentialAttributeDecodersController;
  // Owned by `decoder`, which hands out nothing else; it is moved from and then replaced.
  auto* made =
      const_cast<Controller*>(dynamic_cast<const Controller*>(decoder.attributes_decoder(group)));
  if (!made) return false;
  auto bounded = std::make_unique<BoundedGroup>(std::move(*made), *decoder.mesh(), error);
  return decoder.SetAttributesDecoder(group, std::move(bounded));
}

}  // namespace octrace::gltf
