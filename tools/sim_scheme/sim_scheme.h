// The `sim:` scheme: an instrument inside this process, for the host SDK's transport registry.
#pragma once

#include <cstdint>
#include <memory>

#include "host_sdk/device/transport.h"
#include "host_sdk/error/error.h"

namespace scatter::simulator {
class VirtualInstrument;
}

namespace scatter::tools {

/// A host's end of an instrument in this process. Virtual clock: time passes only in receive() and in a
/// write() that finds no room, so the same calls give the same bytes at the same times; no threads.
///
/// Opening plugs the host in, closing or destroying pulls the plug. Several transports may use one
/// instrument one after the other: that is a host that comes back.
[[nodiscard]] std::unique_ptr<device::Transport> make_sim_transport(
    std::shared_ptr<simulator::VirtualInstrument> instrument);

/// Switches on the instrument that a `sim:` URI describes.
/// Errors  kInvalidArgument: another scheme, a place, an unknown key; those of VirtualInstrument::make.
[[nodiscard]] Result<std::shared_ptr<simulator::VirtualInstrument>> make_sim_instrument(
    const device::Uri& uri);

/// Makes `sim:` known: "sim:" or "sim:?sample=...&seed=..."; see simulator/instrument_options.h. Each
/// opening switches on a fresh instrument.
void register_sim_scheme(device::TransportRegistry& registry);

}  // namespace scatter::tools
