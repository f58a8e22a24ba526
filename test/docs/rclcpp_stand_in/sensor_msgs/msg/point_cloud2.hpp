#pragma once

#include <cstdint>

#include <std_msgs/msg/header.hpp>

namespace sensor_msgs::msg
{
struct PointCloud2
{
  std_msgs::msg::Header header;
  uint32_t height = 0;
  uint32_t width = 0;
};
}  // namespace sensor_msgs::msg
