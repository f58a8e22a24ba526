// The part of rclcpp's interface (Jazzy, 28.1) that our sample uses, without the machinery behind it.
#pragma once

#include <cstddef>
#include <cstdio>
#include <memory>
#include <string>
#include <type_traits>

namespace rclcpp
{
class QoS
{
public:
  QoS(std::size_t) {}  // NOLINT: implicit, as in rclcpp
  QoS & transient_local() { return *this; }
};

class Logger
{
};

template <typename MessageT>
class Publisher
{
public:
  using SharedPtr = std::shared_ptr<Publisher>;
  void publish(const MessageT &) {}
};

template <typename MessageT>
class Subscription
{
public:
  using SharedPtr = std::shared_ptr<Subscription>;
};

class Node
{
public:
  using SharedPtr = std::shared_ptr<Node>;
  explicit Node(const std::string &) {}
  virtual ~Node() = default;
  const char * get_name() const { return ""; }
  Logger get_logger() const { return {}; }

  template <typename MessageT>
  std::shared_ptr<Publisher<MessageT>> create_publisher(const std::string &, const QoS &)
  {
    return {};
  }

  template <typename MessageT, typename CallbackT>
  std::shared_ptr<Subscription<MessageT>> create_subscription(const std::string &, const QoS &, CallbackT &&)
  {
    static_assert(std::is_invocable_r_v<void, CallbackT, const MessageT &>);
    return {};
  }
};

inline void init(int, char const * const *) {}
inline void spin(Node::SharedPtr) {}
inline bool shutdown() { return true; }
}  // namespace rclcpp

#define RCLCPP_INFO(logger, ...) ((void)(logger), std::printf(__VA_ARGS__))
