// PROVES: instrument.md section 5, a calibration is named by the SHA-256 of its content.
#include "host_sdk/measurement/references.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

using namespace scatter;
using namespace scatter::measurement;

namespace {

std::shared_ptr<const ReferenceSet> small_set(float rate) {
  ReferenceSet::Content c;
  c.serial = "SC1";
  c.width = 4;
  c.height = 2;
  c.dark.offset_dn.assign(8, 16.25F);
  c.dark.dark_rate_e_per_s.assign(8, 51.0F);
  c.dark.offset_variance_dn2 = 0.25F;
  c.unix_time_s = 1'767'225'600;
  protocol::ReferenceCertificate certificate;
  certificate.id = "white-1";
  certificate.f_per_sr.push_back(0.315F);
  certificate.relative_uncertainty.push_back(0.003F);
  c.certificates.push_back(certificate);
  ReferenceImages images;
  images.illumination = 7;
  images.reference = {std::vector<float>(8, rate), std::vector<float>(8, 3.3F)};
  images.reference.variance[3] = std::numeric_limits<float>::infinity();
  images.black = {std::vector<float>(8, 10.0F), std::vector<float>(8, 0.1F)};
  images.reference_exposures = {0.001F, 0.004F};
  c.illuminations.push_back(images);
  return ReferenceSet::make(std::move(c));
}

}  // namespace

TEST_CASE("A calibration survives its file bit by bit, and its name with it") {
  const auto set = small_set(1234.5F);
  const auto bytes = set->serialise();
  const auto back = ReferenceSet::parse(bytes);
  REQUIRE(back);
  CHECK((*back)->id() == set->id());
  CHECK((*back)->serialise() == bytes);
  const ReferenceImages* images = (*back)->find(7);
  REQUIRE(images != nullptr);
  CHECK(images->reference.rate[0] == 1234.5F);
  CHECK(images->reference.variance == set->find(7)->reference.variance);
  CHECK(std::isinf(images->reference.variance[3]));
  // Kept in 16 bits, rounded up: never understated, by at most 2^-7.
  CHECK(images->reference.variance[0] >= 3.3F);
  CHECK(images->reference.variance[0] <= 3.3F * (1 + 1.0F / 128));
  CHECK(images->reference_exposures == set->find(7)->reference_exposures);
  CHECK((*back)->certificate(protocol::Target::kWhiteReference)->id.str() == "white-1");
  CHECK((*back)->find(8) == nullptr);
}

TEST_CASE("Other content has another name") {
  CHECK(small_set(1.0F)->id() != small_set(1.5F)->id());
}

TEST_CASE("A calibration cut anywhere is refused with what is missing") {
  const auto bytes = small_set(1.0F)->serialise();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto cut = ReferenceSet::parse(std::span(bytes).first(size));
    REQUIRE_FALSE(cut);
    REQUIRE(cut.error().code == ErrorCode::kDataLoss);
    REQUIRE_FALSE(cut.error().remedy.empty());
  }
}
