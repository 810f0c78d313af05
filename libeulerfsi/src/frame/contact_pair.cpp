#include "frame/contact_pair.hpp"

#include <algorithm>
#include <limits>

namespace efsi::sim {

ContactPair& find_pair(ContactPairs& pairs, std::size_t one, std::size_t other) {
  const auto before = [](const ContactPair& p, const std::pair<std::size_t, std::size_t>& key) {
    return std::pair(p.one, p.other) < key;
  };
  const auto place = std::lower_bound(pairs.begin(), pairs.end(), std::pair(one, other), before);
  if (place != pairs.end() && place->one == one && place->other == other) return *place;
  ContactPair pair;
  pair.one = one;
  pair.other = other;
  pair.row_overlap = pair.surface_overlap = -std::numeric_limits<double>::infinity();
  return *pairs.insert(place, pair);
}

}  // namespace efsi::sim
