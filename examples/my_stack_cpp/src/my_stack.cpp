// A perception node that the world waits for: it sees every lidar cloud.

#include <memory>

#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/point_cloud2.hpp>
#include <std_msgs/msg/header.hpp>
#include <std_msgs/msg/string.hpp>

class MyStack : public rclcpp::Node
{
public:
  MyStack() : Node("my_stack")
  {
    const auto latched = rclcpp::QoS(1).transient_local();
    ready_ = create_publisher<std_msgs::msg::Header>("/sync/ready", latched);
    scenes_ = create_subscription<std_msgs::msg::String>(
      "/world/scene", latched, [this](const std_msgs::msg::String &) {
        // Load what the scene needs here. A first report, whatever its stamp, means "loaded".
        report(builtin_interfaces::msg::Time());
      });
    clouds_ = create_subscription<sensor_msgs::msg::PointCloud2>(
      "/ego/lidar/points", 64, [this](const sensor_msgs::msg::PointCloud2 & cloud) {
        // Your model goes here.
        RCLCPP_INFO(get_logger(), "%d s: %u points", cloud.header.stamp.sec, cloud.width);
        report(cloud.header.stamp);
      });
  }

private:
  void report(const builtin_interfaces::msg::Time & stamp)
  {
    std_msgs::msg::Header header;
    header.frame_id = get_name();
    header.stamp = stamp;
    ready_->publish(header);
  }

  rclcpp::Publisher<std_msgs::msg::Header>::SharedPtr ready_;
  rclcpp::Subscription<std_msgs::msg::String>::SharedPtr scenes_;
  rclcpp::Subscription<sensor_msgs::msg::PointCloud2>::SharedPtr clouds_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<MyStack>());
  rclcpp::shutdown();
}
