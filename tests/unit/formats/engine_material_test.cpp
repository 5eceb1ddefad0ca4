#include "host_sdk/formats/engine_material.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace scatter::formats {
namespace {

const EngineMaterial kMaterial{.name = "brown vinyl <1>",
                               .base_color = {0.1, 0.25, 0.5},
                               .metallic = 0.125,
                               .roughness = 0.375,
                               .specular_factor = 0.75,
                               .ior = 1.625,
                               .comment = "a \"quoted\" & <marked> text\n\xff"};

}  // namespace

TEST_CASE("The index of F0 is that of Fresnel's formula at normal incidence", "[engine_material]") {
  CHECK(ior_of_f0(0.04) == Approx(1.5));
  CHECK(ior_of_f0(0) == Approx(1));
  for (const double n : {1.2, 1.7, 2.4}) {
    const double r = (n - 1) / (n + 1);
    CHECK(ior_of_f0(r * r) == Approx(n));
  }
}

TEST_CASE("A glTF material holds every parameter where the specification has it", "[engine_material]") {
  const auto json = nlohmann::json::parse(gltf_material(kMaterial));
  CHECK(json["asset"]["version"] == "2.0");
  REQUIRE(json["materials"].size() == 1);
  const auto& material = json["materials"][0];
  const auto& core = material["pbrMetallicRoughness"];
  CHECK(core["baseColorFactor"] == nlohmann::json({0.1, 0.25, 0.5, 1.0}));
  CHECK(core["metallicFactor"] == 0.125);
  CHECK(core["roughnessFactor"] == 0.375);
  CHECK(material["extensions"]["KHR_materials_ior"]["ior"] == 1.625);
  CHECK(material["extensions"]["KHR_materials_specular"]["specularFactor"] == 0.75);
  // 3.12: every extension in use is listed.
  CHECK(json["extensionsUsed"].size() == material["extensions"].size());
  for (const auto& name : json["extensionsUsed"]) {
    CHECK(material["extensions"].contains(name.get<std::string>()));
  }
}

TEST_CASE("A MaterialX document is well-formed and names OpenPBR's inputs", "[engine_material]") {
  const std::string text = materialx_material(kMaterial);
  CHECK(text.starts_with("<?xml version=\"1.0\""));
  CHECK(text.find("<input name=\"base_color\" type=\"color3\" value=\"0.1, 0.25, 0.5\" />") !=
        std::string::npos);
  CHECK(text.find("<input name=\"base_metalness\" type=\"float\" value=\"0.125\" />") != std::string::npos);
  CHECK(text.find("<input name=\"specular_roughness\" type=\"float\" value=\"0.375\" />") !=
        std::string::npos);
  CHECK(text.find("<input name=\"specular_ior\" type=\"float\" value=\"1.625\" />") != std::string::npos);
  CHECK(text.find("name=\"brown_vinyl__1_\" type=\"material\"") != std::string::npos);
  CHECK(text.find("nodename=\"brown_vinyl__1__surface\"") != std::string::npos);
  CHECK(text.find("a &quot;quoted&quot; &amp; &lt;marked&gt; text") != std::string::npos);
  // Tags close in the order they opened; quotes pair; nothing but ASCII.
  std::vector<std::string> open;
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1)) {
    const std::size_t end = text.find('>', at);
    REQUIRE(end != std::string::npos);
    const std::string tag = text.substr(at + 1, end - at - 1);
    if (tag.front() == '?' || tag.back() == '/') {
      continue;
    }
    if (tag.front() == '/') {
      REQUIRE_FALSE(open.empty());
      CHECK(open.back() == tag.substr(1));
      open.pop_back();
    } else {
      open.push_back(tag.substr(0, tag.find(' ')));
    }
  }
  CHECK(open.empty());
  CHECK(std::count(text.begin(), text.end(), '"') % 2 == 0);
  CHECK(std::all_of(text.begin(), text.end(), [](char c) { return c == '\n' || (c >= ' ' && c <= '~'); }));
}

TEST_CASE("Material names become valid element names", "[engine_material]") {
  for (const auto& [given, expected] :
       {std::pair{"7up", "m_7up"}, {"", "material"}, {"\xc3\xa9t\xc3\xa9", "__t__"}}) {
    EngineMaterial material = kMaterial;
    material.name = given;
    CHECK(materialx_material(material).find("<surfacematerial name=\"" + std::string(expected) + "\"") !=
          std::string::npos);
  }
}

}  // namespace scatter::formats
