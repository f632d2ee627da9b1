// Makes the session that host and chip replay: a core in a plant with a noisy accelerometer, and a station, in virtual
// time and from fixed seeds.
//
// boot → hello → parameters → manual duty whose lease lapses → auto with a disturbance → a controller change →
// emergency → clear → auto, the link cut → reconnect with backfill in frames of 25 samples.
#pragma once

#include <string>

// Writes the recording to `path`; returns the exit code and says on standard error what did not happen that should.
int record_session(const std::string& path);
