// The BiRD reader: what it accepts is consistent samples, and what our writer makes of it reads back
// as the same number of valid samples.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "host_sdk/formats/bird.h"
#include "host_sdk/formats/sample_list_brdf.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

using namespace scatter::reflectance;

namespace {

std::size_t valid(const ScatteredSamples& samples) {
  std::size_t count = 0;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    count += samples.origin_of(s) != Origin::kInvalid ? 1 : 0;
  }
  return count;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto samples = scatter::formats::decode_bird_samples(text, "fuzz.brdf");
  const auto brdf = scatter::formats::decode_bird(text, "fuzz.brdf");
  require(brdf.has_value() == samples.has_value());
  if (!samples) {
    require(samples.error().what.starts_with("fuzz.brdf: ") && !samples.error().remedy.empty());
    return 0;
  }
  require(check(*samples).has_value() && samples->size() > 0);
  // Memory follows the text.
  require(samples->f_per_sr.size() <= 16 * size + 1024);
  const auto list = scatter::formats::SampleListBrdf::make(*samples);
  require(list.has_value());
  if (valid(*samples) == 0) {
    return 0;
  }
  const auto written = scatter::formats::encode_bird(*list);
  require(written.has_value());
  const auto again = scatter::formats::decode_bird_samples(*written, "again.brdf");
  require(again.has_value() && again->channels <= samples->channels);
  // Angles are gathered to 0.0001 deg; ten digits written keep them apart, or join two at a border.
  require(valid(*again) <= valid(*samples) && 2 * valid(*again) >= valid(*samples));
  return 0;
}
