#include "host_sdk/formats/native_exr.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatVectorAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <Imath/half.h>

#include <exception>
#include <optional>
#include <set>
#include <vector>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/images/exr_header.h"
#include "host_sdk/images/exr_stream.h"

namespace scatter::formats {
namespace {

using reflectance::degrees;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatterType;

constexpr int kVersion = 1;
constexpr std::string_view kMetadataPrefix = "scatter.";
constexpr std::size_t kLongestKey = 200;
constexpr std::size_t kMostParts = 100'000;

std::vector<std::string> channel_names(std::size_t channels) {
  if (channels == 1) {
    return {"Y"};
  }
  if (channels == 3) {
    return {"R", "G", "B"};
  }
  std::vector<std::string> names;
  for (std::size_t c = 0; c < channels; ++c) {
    names.push_back(fmt::format("L{:03}", c));
  }
  return names;
}

Imf::Slice float_slice(const float* plane, std::size_t width) {
  return {Imf::FLOAT, const_cast<char*>(reinterpret_cast<const char*>(plane)), sizeof(float),
          sizeof(float) * width};
}

std::string part_name(const GridPart& part, const std::set<std::string>& taken) {
  std::string name =
      fmt::format("rotation={:.6g} theta_i={:.6g}", degrees(part.rotation_rad) + 0.0, degrees(part.theta_i));
  if (taken.contains(name)) {
    name += fmt::format(" phi_i={:.6g}", degrees(part.phi_i));
  }
  const std::string base = name;
  for (int k = 2; taken.contains(name); ++k) {
    name = fmt::format("{} #{}", base, k);
  }
  return name;
}

Imf::Header header_of(const GridBrdf::Content& content, const GridPart& part,
                      const std::vector<std::string>& names) {
  Imf::Header header(static_cast<int>(content.phi_count), static_cast<int>(content.theta_count));
  header.setType(Imf::SCANLINEIMAGE);
  header.compression() = Imf::NO_COMPRESSION;
  header.insert("bsdfGridVersion", Imf::IntAttribute(kVersion));
  header.insert("bsdfType",
                Imf::StringAttribute(content.type == ScatterType::kBrdf ? std::string("BRDF") : "BTDF"));
  header.insert("bsdfWavelengths", Imf::FloatVectorAttribute(content.wavelengths_nm));
  header.insert("bsdfRotation", Imf::DoubleAttribute(degrees(part.rotation_rad)));
  header.insert("bsdfIncidenceTheta", Imf::DoubleAttribute(degrees(part.theta_i)));
  header.insert("bsdfIncidencePhi", Imf::DoubleAttribute(degrees(part.phi_i)));
  header.insert("bsdfThetaStep", Imf::DoubleAttribute(degrees(content.theta_step)));
  header.insert("bsdfPhiStep", Imf::DoubleAttribute(degrees(content.phi_step)));
  for (const std::string& name : names) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    if (!part.random_per_sr.empty()) {
      header.channels().insert("random." + name, Imf::Channel(Imf::FLOAT));
    }
    if (!part.systematic_per_sr.empty()) {
      header.channels().insert("systematic." + name, Imf::Channel(Imf::FLOAT));
    }
  }
  if (!part.pixels.empty()) {
    header.channels().insert("pixels", Imf::Channel(Imf::FLOAT));
  }
  header.channels().insert("origin", Imf::Channel(Imf::HALF));
  return header;
}

void write_part(const GridBrdf::Content& content, const GridPart& part, const std::vector<std::string>& names,
                Imf::OutputPart out) {
  Imf::FrameBuffer buffer;
  const std::size_t width = content.phi_count;
  for (std::size_t c = 0; c < names.size(); ++c) {
    buffer.insert(names[c], float_slice(part.f_per_sr[c].data(), width));
    if (!part.random_per_sr.empty()) {
      buffer.insert("random." + names[c], float_slice(part.random_per_sr[c].data(), width));
    }
    if (!part.systematic_per_sr.empty()) {
      buffer.insert("systematic." + names[c], float_slice(part.systematic_per_sr[c].data(), width));
    }
  }
  if (!part.pixels.empty()) {
    buffer.insert("pixels", float_slice(part.pixels.data(), width));
  }
  std::vector<half> origin(part.origin.size());
  for (std::size_t n = 0; n < origin.size(); ++n) {
    origin[n] = half(static_cast<float>(part.origin[n]));
  }
  buffer.insert("origin", Imf::Slice(Imf::HALF, reinterpret_cast<char*>(origin.data()), sizeof(half),
                                     sizeof(half) * width));
  out.setFrameBuffer(buffer);
  out.writePixels(static_cast<int>(content.theta_count));
}

/// Decoding one file; every step gives the error of the file.
class Decoder {
 public:
  Decoder(std::string_view bytes, std::string_view name) : bytes_(bytes), name_(name) {}

  Result<GridBrdf> decode() {
    images::ExrMemoryInput stream(bytes_, name_.c_str());
    Imf::MultiPartInputFile file(stream, 0);
    if (file.parts() < 1 || static_cast<std::size_t>(file.parts()) > kMostParts) {
      return bad(fmt::format("has {} parts", file.parts()));
    }
    GridBrdf::Content content;
    for (int p = 0; p < file.parts(); ++p) {
      if (Status status = read_part(file, p, content); !status) {
        return std::unexpected(status.error());
      }
    }
    auto grid = GridBrdf::make(std::move(content));
    if (!grid) {
      return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name_, grid.error().what), kRemedy);
    }
    return grid;
  }

 private:
  static constexpr const char* kRemedy = "measure or export the file again";

  [[nodiscard]] std::unexpected<Error> bad(const std::string& what) const {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{}: {}", name_, what), kRemedy);
  }

  template <typename Attribute, typename Value>
  [[nodiscard]] Status get(const Imf::Header& header, int part, const char* key, Value& out) const {
    const auto* attribute = header.findTypedAttribute<Attribute>(key);
    if (attribute == nullptr) {
      return bad(
          fmt::format("part {} has no attribute {}; it is an EXR image, but not a BRDF grid", part, key));
    }
    out = attribute->value();
    return {};
  }

  Status read_part(Imf::MultiPartInputFile& file, int index, GridBrdf::Content& content) {
    const Imf::Header& header = file.header(index);
    GridPart part;
    GridBrdf::Content here;
    std::string type;
    int version = 0;
    double rotation = 0;
    double theta = 0;
    double phi = 0;
    double theta_step = 0;
    double phi_step = 0;
    for (const Status& status :
         {get<Imf::IntAttribute>(header, index, "bsdfGridVersion", version),
          get<Imf::StringAttribute>(header, index, "bsdfType", type),
          get<Imf::FloatVectorAttribute>(header, index, "bsdfWavelengths", here.wavelengths_nm),
          get<Imf::DoubleAttribute>(header, index, "bsdfRotation", rotation),
          get<Imf::DoubleAttribute>(header, index, "bsdfIncidenceTheta", theta),
          get<Imf::DoubleAttribute>(header, index, "bsdfIncidencePhi", phi),
          get<Imf::DoubleAttribute>(header, index, "bsdfThetaStep", theta_step),
          get<Imf::DoubleAttribute>(header, index, "bsdfPhiStep", phi_step)}) {
      if (!status) {
        return status;
      }
    }
    if (version != kVersion) {
      return fail(ErrorCode::kVersionMismatch,
                  fmt::format("{}: grid version {}, expected {}", name_, version, kVersion),
                  "update this software");
    }
    if (type != "BRDF" && type != "BTDF") {
      return bad(fmt::format("part {}: bsdfType is '{}', expected BRDF or BTDF", index, type));
    }
    here.type = type == "BRDF" ? ScatterType::kBrdf : ScatterType::kBtdf;
    part.rotation_rad = radians(rotation);
    part.theta_i = radians(theta);
    part.phi_i = radians(phi);
    here.theta_step = radians(theta_step);
    here.phi_step = radians(phi_step);
    const Imath::Box2i& window = header.dataWindow();
    here.phi_count = static_cast<std::size_t>(std::int64_t{window.max.x} - window.min.x + 1);
    here.theta_count = static_cast<std::size_t>(std::int64_t{window.max.y} - window.min.y + 1);
    if (Status status = read_planes(file, index, here, part); !status) {
      return status;
    }
    if (index == 0) {
      read_metadata(header, here);
      content = std::move(here);
    } else if (here.type != content.type || here.wavelengths_nm != content.wavelengths_nm ||
               here.channels != content.channels || here.theta_count != content.theta_count ||
               here.phi_count != content.phi_count || here.theta_step != content.theta_step ||
               here.phi_step != content.phi_step) {
      return bad(fmt::format("part {} differs from part 0 in type, wavelengths or grid", index));
    }
    content.parts.push_back(std::move(part));
    return {};
  }

  static void read_metadata(const Imf::Header& header, GridBrdf::Content& content) {
    for (auto it = header.begin(); it != header.end(); ++it) {
      const std::string_view key = it.name();
      const auto* text = dynamic_cast<const Imf::StringAttribute*>(&it.attribute());
      if (text != nullptr && key.starts_with(kMetadataPrefix)) {
        content.metadata.emplace(key.substr(kMetadataPrefix.size()), text->value());
      }
    }
  }

  Status read_planes(Imf::MultiPartInputFile& file, int index, GridBrdf::Content& here, GridPart& part) {
    const Imf::Header& header = file.header(index);
    const Imf::ChannelList& list = header.channels();
    if (header.hasType() && header.type() != Imf::SCANLINEIMAGE) {
      return bad(fmt::format("part {} is of type {}, expected {}", index, header.type(), Imf::SCANLINEIMAGE));
    }
    std::size_t channels = 0;
    std::size_t planes = 0;
    for (auto it = list.begin(); it != list.end(); ++it, ++planes) {
      const std::string_view name = it.name();
      channels += name == "Y" || name == "R" || name == "G" || name == "B" ||
                  (name.size() == 4 && name.starts_with('L'));
      if (it.channel().xSampling != 1 || it.channel().ySampling != 1) {
        return bad(fmt::format("part {}: channel {} is subsampled", index, name));
      }
    }
    here.channels = channels;
    if (!images::can_hold(header, planes, bytes_.size())) {
      return fail(ErrorCode::kDataLoss,
                  fmt::format("{}: {} for the {} x {} nodes in {} channels of part {}", name_,
                              images::ends_early(header, planes, bytes_.size()), here.phi_count,
                              here.theta_count, planes, index),
                  kRemedy);
    }
    const std::size_t nodes = here.phi_count * here.theta_count;
    Imf::FrameBuffer buffer;
    const Imath::Box2i& window = header.dataWindow();
    const auto attach = [&](const std::string& name, std::vector<float>& plane) {
      plane.resize(nodes);
      buffer.insert(name, Imf::Slice::Make(Imf::FLOAT, plane.data(), window, sizeof(float),
                                           sizeof(float) * here.phi_count));
    };
    std::size_t random = 0;
    std::size_t systematic = 0;
    const std::vector<std::string> names = channel_names(channels);
    for (const std::string& name : names) {
      if (list.findChannel(name) == nullptr) {
        return bad(fmt::format("part {} has {} value channels, but none called {}", index, channels, name));
      }
      random += list.findChannel("random." + name) != nullptr;
      systematic += list.findChannel("systematic." + name) != nullptr;
    }
    if ((random != 0 && random != channels) || (systematic != 0 && systematic != channels)) {
      return bad(fmt::format("part {}: {} random and {} systematic channels for {} value channels", index,
                             random, systematic, channels));
    }
    if (channels == 0 || list.findChannel("origin") == nullptr) {
      return bad(fmt::format("part {} has no channel {}", index, channels == 0 ? "R, G, B or Y" : "origin"));
    }
    part.f_per_sr.resize(channels);
    part.random_per_sr.resize(random);
    part.systematic_per_sr.resize(systematic);
    for (std::size_t c = 0; c < channels; ++c) {
      attach(names[c], part.f_per_sr[c]);
      if (random != 0) {
        attach("random." + names[c], part.random_per_sr[c]);
      }
      if (systematic != 0) {
        attach("systematic." + names[c], part.systematic_per_sr[c]);
      }
    }
    if (list.findChannel("pixels") != nullptr) {
      attach("pixels", part.pixels);
    }
    std::vector<float> origin;
    attach("origin", origin);
    Imf::InputPart in(file, index);
    in.setFrameBuffer(buffer);
    in.readPixels(window.min.y, window.max.y);
    part.origin.resize(nodes);
    for (std::size_t n = 0; n < nodes; ++n) {
      if (!(origin[n] == 0 || origin[n] == 1 || origin[n] == 2 || origin[n] == 3)) {
        return bad(
            fmt::format("part {}: origin of node {} is {}, expected 0, 1, 2 or 3", index, n, origin[n]));
      }
      part.origin[n] = static_cast<Origin>(origin[n]);
    }
    return {};
  }

  std::string_view bytes_;
  std::string name_;
};

}  // namespace

Result<std::string> encode_native_exr(const GridBrdf& grid) {
  const GridBrdf::Content& content = grid.content();
  if (content.channels > 1000) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{} channels, at most 1000", content.channels),
                "keep fewer wavelengths");
  }
  try {
    const std::vector<std::string> names = channel_names(content.channels);
    std::vector<Imf::Header> headers;
    std::set<std::string> taken;
    std::size_t size = 65536;
    for (const GridPart& part : content.parts) {
      Imf::Header header = header_of(content, part, names);
      const std::string name = part_name(part, taken);
      taken.insert(name);
      header.setName(name);
      headers.push_back(std::move(header));
      size += part.origin.size() * sizeof(float) * (3 * content.channels + 2);
    }
    for (const auto& [key, value] : content.metadata) {
      if (key.empty() || key.size() > kLongestKey || key.find('\0') != std::string::npos) {
        return fail(ErrorCode::kInvalidArgument,
                    fmt::format("metadata key '{}' is not 1..200 characters", key), "use a short key");
      }
      headers.front().insert(std::string(kMetadataPrefix) + key, Imf::StringAttribute(value));
    }
    images::ExrMemoryOutput stream(size);
    {
      Imf::MultiPartOutputFile file(stream, headers.data(), static_cast<int>(headers.size()), false, 0);
      for (std::size_t p = 0; p < headers.size(); ++p) {
        write_part(content, content.parts[p], names, Imf::OutputPart(file, static_cast<int>(p)));
      }
    }
    return stream.take();
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, fmt::format("EXR encoder: {}", error.what()), "report this");
  }
}

Result<GridBrdf> decode_native_exr(std::string_view bytes, std::string_view name) {
  if (Status status = images::check_exr_header(bytes, name); !status) {
    return std::unexpected(status.error());
  }
  try {
    return Decoder(bytes, name).decode();
  } catch (const std::exception& error) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name, error.what()),
                "the file is damaged or incomplete: export it again");
  }
}

Status write_native_exr(const GridBrdf& grid, const std::filesystem::path& path) {
  const auto bytes = encode_native_exr(grid);
  return bytes ? write_file(path, *bytes) : std::unexpected(bytes.error());
}

Result<GridBrdf> read_native_exr(const std::filesystem::path& path) {
  const auto bytes = read_file(path);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  return decode_native_exr(*bytes, path.string());
}

}  // namespace scatter::formats
