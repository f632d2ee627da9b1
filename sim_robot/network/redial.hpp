// How long a robot waits before it dials its station again.
//
// Pauses are random, so that robots that lost one station do not come back at once. While the ring has room no
// sample is lost yet, so attempts begin at most 1 s apart. Once the ring is full samples are lost whatever the robot
// does, and pauses grow to four times as long.
#pragma once

#include <algorithm>
#include <chrono>
#include <random>

namespace sim_robot {

class Redial {
 public:
  using Milliseconds = std::chrono::milliseconds;

  // An attempt without an answer ends after this, which is pause enough: the next one follows at once.
  static constexpr Milliseconds kConnectTimeout{1000};
  static constexpr Milliseconds kShortest{100}, kLongest{600};
  static constexpr int kMostTimes = 4;  // as long, with a full ring

  void welcomed() { times_ = 1; }

  // From the end of a connection, or from the beginning of an attempt that failed.
  template <class Random>
  Milliseconds next(Random& random, bool ring_has_room) {
    const Milliseconds once{
        std::uniform_int_distribution<Milliseconds::rep>{kShortest.count(), kLongest.count()}(random)};
    if (ring_has_room) times_ = 1;
    const Milliseconds pause = times_ * once;
    if (!ring_has_room) times_ = std::min(times_ + 1, kMostTimes);
    return pause;
  }

 private:
  int times_ = 1;
};

}  // namespace sim_robot
