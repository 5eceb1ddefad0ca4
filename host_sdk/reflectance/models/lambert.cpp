#include "host_sdk/reflectance/models/lambert.h"

#include "host_sdk/reflectance/models/lobes.h"

namespace scatter::reflectance {

Lambert::Lambert(const ChannelValues& albedo) : LobeModel({{make_lambert_lobe(albedo)}}), albedo_(albedo) {}

}  // namespace scatter::reflectance
