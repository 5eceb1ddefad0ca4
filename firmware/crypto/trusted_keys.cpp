#include "firmware/crypto/trusted_keys.h"

#ifdef SCATTER_RELEASE_BUILD
#include <scatter_release_keys.h>  // Generated: kReleaseKeys.
#endif

namespace scatter::firmware {

std::span<const TrustedKey> trusted_keys() noexcept {
#ifdef SCATTER_RELEASE_BUILD
  return kReleaseKeys;
#else
  return {&kTestKey, 1};
#endif
}

}  // namespace scatter::firmware
