// What a search has found so far, for one instruction set. Included by traverse.cpp only.
// Per-target include guard, as Highway asks for.
#if defined(SCATTER_SEARCH_FOUND_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SCATTER_SEARCH_FOUND_INL_H
#undef SCATTER_SEARCH_FOUND_INL_H
#else
#define SCATTER_SEARCH_FOUND_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "host_sdk/reflectance/search/tree.h"

HWY_BEFORE_NAMESPACE();
namespace scatter::search::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 16>;
using Keys = hn::CappedTag<double, 8>;
constexpr Floats kFloats;
constexpr Keys kKeys;
using FloatVector = hn::Vec<Floats>;
using KeyVector = hn::Vec<Keys>;
constexpr std::size_t kLanes = hn::MaxLanes(kFloats);
constexpr std::size_t kKeyLanes = hn::MaxLanes(kKeys);
constexpr std::size_t kSteps = kFanOut / kLanes;

constexpr std::size_t kPlaced = 48;  // Points of a first leaf up to which each is put in its place at once.
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A neighbour as one number that sorts by (distance, id): the bits of the distance above those of
// the id, read as a positive double, because minimum and maximum of doubles exist everywhere. The
// distance is lifted by one step of a double's exponent: no key is subnormal, so that a caller's
// flush-to-zero mode changes nothing; even an infinite distance makes a finite key.
constexpr std::uint32_t kLift = 0x00100000;
constexpr double kNoKey = std::numeric_limits<double>::max();

HWY_INLINE double key_of(std::uint32_t distance_bits, std::uint32_t id) {
  return std::bit_cast<double>(std::uint64_t{distance_bits + kLift} << 32 | id);
}
HWY_INLINE float distance_of(double key) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(key) >> 32) - kLift);
}
HWY_INLINE Neighbor neighbor_of(double key) {
  return {distance_of(key), static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(key))};
}

struct Query {
  FloatVector x[kAxes];
};

HWY_INLINE Query spread(const Point& p) {
  return {
      {hn::Set(kFloats, p.x_i), hn::Set(kFloats, p.y_i), hn::Set(kFloats, p.x_o), hn::Set(kFloats, p.y_o)}};
}

HWY_INLINE FloatVector sum_of_squares(FloatVector a, FloatVector b, FloatVector c, FloatVector d) {
  return hn::Add(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Add(hn::Mul(c, c), hn::Mul(d, d)));
}

// To the points of a mixed leaf: exactly distance_squared.
HWY_INLINE FloatVector to_points(const Query& q, const float* first, std::size_t slots) {
  return sum_of_squares(hn::Sub(q.x[0], hn::LoadU(kFloats, first)),
                        hn::Sub(q.x[1], hn::LoadU(kFloats, first + slots)),
                        hn::Sub(q.x[2], hn::LoadU(kFloats, first + 2 * slots)),
                        hn::Sub(q.x[3], hn::LoadU(kFloats, first + 3 * slots)));
}

// The same where the points share omega_i; `incident` is the sum of the first two squares.
HWY_INLINE FloatVector to_shared_points(const Query& q, FloatVector incident, const float* first,
                                        std::size_t slots) {
  const FloatVector x = hn::Sub(q.x[2], hn::LoadU(kFloats, first));
  const FloatVector y = hn::Sub(q.x[3], hn::LoadU(kFloats, first + slots));
  return hn::Add(incident, hn::Add(hn::Mul(x, x), hn::Mul(y, y)));
}

HWY_INLINE FloatVector to_side(FloatVector q, const float* lo, const float* hi) {
  const FloatVector below = hn::Sub(hn::Load(kFloats, lo), q);
  const FloatVector above = hn::Sub(q, hn::Load(kFloats, hi));
  const FloatVector d = hn::Max(hn::Max(below, above), hn::Zero(kFloats));
  return hn::Mul(d, d);
}

// To the boxes of a node: the part of omega_i, the part of omega_o. Rounding is monotonic and the
// operations are those of to_points, so that no point in a box is ever nearer than their sum; where
// all points in a box share omega_i, its part is exactly theirs.
HWY_INLINE FloatVector to_incident_sides(const Query& q, const Node& node, std::size_t first) {
  return hn::Add(to_side(q.x[0], node.lo[0] + first, node.hi[0] + first),
                 to_side(q.x[1], node.lo[1] + first, node.hi[1] + first));
}
HWY_INLINE FloatVector to_outgoing_sides(const Query& q, const Node& node, std::size_t first) {
  return hn::Add(to_side(q.x[2], node.lo[2] + first, node.hi[2] + first),
                 to_side(q.x[3], node.lo[3] + first, node.hi[3] + first));
}

// Bit k is set where lane k holds.
template <typename Mask>
HWY_INLINE std::uint32_t bits_of(Mask mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(kFloats, mask, bytes);
  std::uint16_t bits = 0;
  std::memcpy(&bits, bytes, 2);
  return bits;
}

HWY_INLINE hn::Mask<Floats> mask_of(std::uint32_t bits) {
  std::uint8_t bytes[8] = {};
  std::memcpy(bytes, &bits, 4);
  return hn::LoadMaskBits(kFloats, bytes);
}

// The nearest so far, at most kCapacity, in registers while a leaf is scanned.
template <std::size_t kCapacity>
class FewNearest {
 public:
  static constexpr bool kPlaces = true;  ///< Has `place`.

  explicit FewNearest(std::size_t k) : last_(k - 1) { start(); }

  void start() {
    for (double& key : keys_) {
      key = kNoKey;
    }
    worst_ = kInfinity;
  }

  [[nodiscard]] HWY_INLINE float worst() const { return worst_; }
  [[nodiscard]] HWY_INLINE std::size_t wanted() const { return last_ + 1; }
  void limit(float worst) { worst_ = worst; }

  /// Takes in what `bits` marks among `distances`.
  HWY_INLINE void take(std::uint64_t bits, const float* distances, const Leaf& leaf) {
    take(bits, distances, leaf.ids());
  }
  HWY_INLINE void take(std::uint64_t bits, const float* distances, const std::uint32_t* ids) {
    KeyVector key[kVectors];
    for (std::size_t v = 0; v < kVectors; ++v) {
      key[v] = hn::Load(kKeys, keys_ + v * kKeyLanes);
    }
    const auto turn = hn::SetTableIndices(kKeys, kTurn);
    const auto turn_twice = hn::SetTableIndices(kKeys, kTurnTwice);
    const auto first = hn::FirstN(kKeys, 1);
    const auto first_two = hn::FirstN(kKeys, 2);
    const auto lowest = [&](std::uint64_t among) HWY_ATTR {
      const auto lane = static_cast<std::size_t>(std::countr_zero(among));
      std::uint32_t distance_bits = 0;
      std::memcpy(&distance_bits, distances + lane, 4);
      return key_of(distance_bits, ids[lane]);
    };
    do {
      // Two at a time: each step waits for the one before, and this halves the steps.
      const double a = lowest(bits);
      bits &= bits - 1;
      const double b = kKeyLanes > 1 && bits != 0 ? lowest(bits) : kNoKey;
      bits &= kKeyLanes > 1 ? bits - 1 : bits;
      const KeyVector low = hn::Set(kKeys, std::min(a, b));
      const KeyVector high = hn::Set(kKeys, std::max(a, b));
      // Merging with a sorted row without a branch:
      // key'[j] = min(key[j], max(key[j - 1], low), max(key[j - 2], high)).
      KeyVector carried = hn::Zero(kKeys);
      KeyVector carried_twice = hn::Zero(kKeys);
      for (std::size_t v = 0; v < kVectors; ++v) {
        const KeyVector turned = hn::TableLookupLanes(key[v], turn);
        const KeyVector turned_twice = hn::TableLookupLanes(key[v], turn_twice);
        const KeyVector one = hn::Max(hn::IfThenElse(first, carried, turned), low);
        const KeyVector two = hn::Max(hn::IfThenElse(first_two, carried_twice, turned_twice), high);
        key[v] = hn::Min(key[v], hn::Min(one, two));
        carried = turned;
        carried_twice = turned_twice;
      }
    } while (bits != 0);
    for (std::size_t v = 0; v < kVectors; ++v) {
      hn::Store(key[v], kKeys, keys_ + v * kKeyLanes);
    }
    set_worst();
  }

  /// The same as `take` while nothing was taken in yet, from at most kPlaced points of which `bits` marks at
  /// least wanted(). All kPlaced distances can be read.
  HWY_INLINE void place(std::uint64_t bits, const float* distances, const std::uint32_t* ids,
                        std::size_t count) {
    if (count <= 32) {
      place_among<32>(bits, distances, ids, count);
    } else {
      place_among<kPlaced>(bits, distances, ids, count);
    }
  }

  HWY_INLINE std::size_t give(std::size_t k, Neighbor* out) const {
    // neighbor_of, a vector at a time.
    static_assert(std::endian::native == std::endian::little);
    std::size_t found = 0;
    for (std::size_t first = 0; first < k; first += kKeyLanes) {
      const KeyVector key = hn::Load(kKeys, keys_ + first);
      const std::size_t room = std::min(k - first, kKeyLanes);
      const std::size_t here = std::min(hn::CountTrue(kKeys, hn::Lt(key, hn::Set(kKeys, kNoKey))), room);
      const auto bits = hn::BitCast(kBits, key);
      const auto distance = hn::Sub(hn::ShiftRight<32>(bits), hn::Set(kBits, kLift));
      write(hn::Or(distance, hn::ShiftLeft<32>(bits)), here, out + first);
      found += here;
    }
    return found;
  }

 private:
  using Rows = hn::RebindToUnsigned<Keys>;
  static constexpr Rows kBits{};

  // The first `count` neighbours of a vector of them.
  static HWY_INLINE void write(hn::Vec<Rows> rows, std::size_t count, Neighbor* out) {
#if HWY_TARGET <= HWY_AVX2 && HWY_ARCH_X86
    hn::BlendedStore(rows, hn::FirstN(kBits, count), kBits, reinterpret_cast<std::uint64_t*>(out));
#else
    // Elsewhere a masked store may touch what it does not write.
    alignas(64) std::uint64_t all[kKeyLanes];
    hn::Store(rows, kBits, all);
    std::memcpy(static_cast<void*>(out), all, count * sizeof(Neighbor));
#endif
  }

  // Each point's place is the number of points that are nearer.
  template <std::size_t kMost>
  HWY_INLINE void place_among(std::uint64_t bits, const float* distances, const std::uint32_t* ids,
                              std::size_t count) {
    constexpr hn::RebindToUnsigned<Floats> kInts;
    constexpr std::size_t kParts = kMost / kLanes;
    FloatVector distance[kParts];
    hn::Vec<decltype(kInts)> place[kParts];
    for (std::size_t v = 0; v < kParts; ++v) {
      distance[v] = hn::Load(kFloats, distances + v * kLanes);
      place[v] = hn::Zero(kInts);
    }
    const auto one = hn::Set(kInts, 1);
    for (std::size_t n = 0; n < count; ++n) {
      const FloatVector other = hn::Set(kFloats, distances[n]);
      for (std::size_t v = 0; v < kParts; ++v) {
        const auto nearer = hn::RebindMask(kInts, hn::Lt(other, distance[v]));
        place[v] = hn::IfThenElse(nearer, hn::Add(place[v], one), place[v]);
      }
    }
    alignas(64) std::uint32_t places[kMost];
    const auto end = hn::Set(kInts, static_cast<std::uint32_t>(wanted()));
    std::uint64_t near = 0;
    for (std::size_t v = 0; v < kParts; ++v) {
      hn::Store(place[v], kInts, places + v * kLanes);
      near |= std::uint64_t{bits_of(hn::RebindMask(kFloats, hn::Lt(place[v], end)))} << (v * kLanes);
    }
    near &= bits;
    std::uint32_t taken = 0;
    for (std::uint64_t rest = near; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      keys_[places[lane]] = key_of(std::bit_cast<std::uint32_t>(distances[lane]), ids[lane]);
      taken |= 1U << places[lane];
    }
    // Equal distances share a place and leave others empty, or are too many for the last one.
    const std::uint32_t all = (std::uint32_t{2} << last_) - 1;
    if (taken == all && static_cast<std::size_t>(std::popcount(near)) == wanted()) {
      set_worst();
    } else {
      take_anew(near, distances, ids);
    }
  }

  HWY_NOINLINE void take_anew(std::uint64_t bits, const float* distances, const std::uint32_t* ids) {
    start();
    take(bits, distances, ids);
  }

  HWY_INLINE void set_worst() {
    const double last = keys_[last_];
    worst_ = last == kNoKey ? worst_ : std::min(distance_of(last), worst_);
  }

  static constexpr std::size_t kVectors = kCapacity / kKeyLanes;
  // Lane j takes lane j - 1; lane 0 the last, for the vector that follows.
  static constexpr std::int64_t kTurn[8] = {kKeyLanes - 1, 0, 1, 2, 3, 4, 5, 6};
  // Lane j - 2 likewise; without use where a vector is a single key.
  static constexpr std::int64_t kTurnTwice[8] = {
      (2 * kKeyLanes - 2) % kKeyLanes, kKeyLanes - 1, 0, 1, 2, 3, 4, 5};

  alignas(64) double keys_[kCapacity];
  float worst_ = kInfinity;
  std::size_t last_ = 0;
};

// The same, and where the points lie: how far another query is from them limits its search.
template <std::size_t kCapacity>
class PlacedNearest : public FewNearest<kCapacity> {
 public:
  static constexpr bool kPlaces = false;  // It must see every point that is taken in.

  using FewNearest<kCapacity>::FewNearest;

  void start() {
    FewNearest<kCapacity>::start();
    count_ = 0;
    full_ = false;
  }

  HWY_INLINE void take(std::uint64_t bits, const float* distances, const Leaf& leaf) {
    FewNearest<kCapacity>::take(bits, distances, leaf);
    for (; bits != 0 && count_ < kRoom; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      distance_[count_] = distances[lane];
      const Point p = leaf.point(lane);
      at_[0][count_] = p.x_i;
      at_[1][count_] = p.y_i;
      at_[2][count_] = p.x_o;
      at_[3][count_] = p.y_o;
      ++count_;
    }
    if (count_ == kRoom) {
      forget();
      full_ |= count_ == kRoom;
    }
  }

  /// Whether at least k points were found and their places are all known.
  bool knows(std::size_t k) {
    forget();
    return count_ >= k && !full_;
  }

  /// Box of the points found, once `knows`.
  void bound(Box& box) const {
    for (std::size_t a = 0; a < kAxes; ++a) {
      const auto [lo, hi] = std::minmax_element(at_[a], at_[a] + count_);
      box.lo[a] = *lo;
      box.hi[a] = *hi;
    }
  }

  /// Upper limit of the k-th distance from another place, once `knows`.
  HWY_INLINE float limit_at(const Query& q) const {
    FloatVector most = hn::Zero(kFloats);
    for (std::size_t n = 0; n < count_; n += kLanes) {
      const FloatVector d = sum_of_squares(
          hn::Sub(q.x[0], hn::Load(kFloats, at_[0] + n)), hn::Sub(q.x[1], hn::Load(kFloats, at_[1] + n)),
          hn::Sub(q.x[2], hn::Load(kFloats, at_[2] + n)), hn::Sub(q.x[3], hn::Load(kFloats, at_[3] + n)));
      most = hn::Max(most, hn::IfThenElseZero(hn::FirstN(kFloats, count_ - n), d));
    }
    return hn::GetLane(hn::MaxOfLanes(kFloats, most));
  }

 private:
  static constexpr std::size_t kRoom = 128;

  // Drops what has been pushed out by nearer points.
  HWY_INLINE void forget() {
    std::size_t kept = 0;
    for (std::size_t n = 0; n < count_; ++n) {
      const bool keep = distance_[n] <= this->worst();
      distance_[kept] = distance_[n];
      for (std::size_t a = 0; a < kAxes; ++a) {
        at_[a][kept] = at_[a][n];
      }
      kept += keep ? 1 : 0;
    }
    count_ = kept;
  }

  std::size_t count_ = 0;
  bool full_ = false;
  alignas(64) float distance_[kRoom];
  alignas(64) float at_[kAxes][kRoom];
};

// Any number of neighbours: a heap with the farthest on top.
class ManyNearest {
 public:
  static constexpr bool kPlaces = false;

  explicit ManyNearest(std::size_t k, std::vector<double>& room) : k_(k), heap_(room) { heap_.clear(); }

  [[nodiscard]] float worst() const { return worst_; }
  [[nodiscard]] std::size_t wanted() const { return k_; }
  void limit(float worst) { worst_ = worst; }

  void take(std::uint64_t bits, const float* distances, const Leaf& leaf) {
    const std::uint32_t* ids = leaf.ids();
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      const double key = key_of(std::bit_cast<std::uint32_t>(distances[lane]), ids[lane]);
      if (heap_.size() < k_) {
        heap_.push_back(key);
        std::push_heap(heap_.begin(), heap_.end());
      } else if (key < heap_.front()) {
        std::pop_heap(heap_.begin(), heap_.end());
        heap_.back() = key;
        std::push_heap(heap_.begin(), heap_.end());
      }
    }
    if (heap_.size() == k_) {
      worst_ = std::min(distance_of(heap_.front()), worst_);
    }
  }

  std::size_t give(std::size_t, Neighbor* out) {
    std::sort_heap(heap_.begin(), heap_.end());
    std::transform(heap_.begin(), heap_.end(), out, [](double key) HWY_ATTR { return neighbor_of(key); });
    return heap_.size();
  }

 private:
  std::size_t k_;
  std::vector<double>& heap_;
  float worst_ = kInfinity;
};

// Everything within a radius.
class Within {
 public:
  static constexpr bool kPlaces = false;

  Within(float worst, std::vector<Neighbor>& out) : worst_(worst), out_(out) {}

  [[nodiscard]] float worst() const { return worst_; }
  [[nodiscard]] static std::size_t wanted() { return kLeafCapacity; }  // All there are.

  void take(std::uint64_t bits, const float* distances, const Leaf& leaf) {
    const std::uint32_t* ids = leaf.ids();
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      out_.push_back({distances[lane], ids[lane]});
    }
  }

 private:
  float worst_;
  std::vector<Neighbor>& out_;
};

}  // namespace
}  // namespace scatter::search::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
