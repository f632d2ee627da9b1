// Stub of the Wi-Fi library.
#pragma once

#include <cstdint>

#include "IPAddress.h"

enum wl_status_t { WL_CONNECTED = 3, WL_DISCONNECTED = 7 };
enum WiFiMode_t { WIFI_STA = 1 };
enum WiFiSleepType_t { WIFI_NONE_SLEEP = 0, WIFI_MODEM_SLEEP = 2 };

class WiFiClass {
 public:
  void persistent(bool on);
  void setAutoReconnect(bool on);
  void mode(WiFiMode_t mode);
  void setSleepMode(WiFiSleepType_t type);
  void begin(const char* name, const char* password);
  wl_status_t status();
  std::int32_t RSSI();
  int hostByName(const char* name, IPAddress& address, std::uint32_t timeout_ms);
};
extern WiFiClass WiFi;
