// The thin layer over Fast DDS: participants that send and receive encoded messages.
//
// Topics carry typed IDL messages (see idl/), but this layer only moves their bytes: what is
// encoded once is written as it is, and a reader hands out the bytes as they came. The QoS below
// was chosen by measurement; ARCHITECTURE.md tells why.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "graph/description.hpp"
#include "graph/stage.hpp"
#include "graph/topics.hpp"
#include "idl/codec.hpp"

namespace eprosima::fastdds::dds {
class DomainParticipantListener;
}

namespace cosegraph::graph {

struct EndpointQos {
  int depth = 1;              // samples kept for late or slow readers
  bool keep_for_late = true;  // a reader that comes later gets the newest `depth` samples
  bool reliable = true;       // what is lost on the way is sent again
};

class Writer {
 public:
  virtual ~Writer() = default;
  // Throws Error if DDS refuses the sample.
  virtual void write(const idl::Bytes& bytes) = 0;
  // How many readers it has found.
  virtual int matched() const = 0;
  // Waits until they have all that was written; false if that takes longer than `patience`.
  virtual bool await_readers(std::chrono::milliseconds patience) = 0;
};

class Reader {
 public:
  virtual ~Reader() = default;
  // How many writers it has found.
  virtual int matched() const = 0;
  // How many it has refused because they offer less than it asks for.
  virtual int refused() const = 0;
};

// Within one process messages are handed over directly, else they go by UDP. A stage that feeds
// another host sends messages of one packet, with security of six, which need more of the CPU than
// large ones but arrive where packets are lost.
class Participant {
 public:
  // `identity`: whose keys it has, if the graph has security. `listener`, who is told of other
  // participants (see discovery.hpp), must outlive the participant. Throws GraphError if the keys
  // cannot be used, Error naming the domain if DDS cannot be started.
  Participant(const GraphDescription& graph, const std::string& name,
              const Identity& identity = Identity::observer(),
              eprosima::fastdds::dds::DomainParticipantListener* listener = nullptr);
  // For topics of others: no partition, discovery by multicast.
  Participant(int domain, const std::string& name);
  ~Participant();

  // `type` is the name of one of our types ("Cloud"), or that of any other on the wire ("a::b::C").
  std::unique_ptr<Writer> writer(const std::string& topic, std::string_view type,
                                 const EndpointQos& qos);
  // `receive` is called from DDS threads (or from the writer's own, within a process), one sample
  // at a time per reader; it must not block.
  std::unique_ptr<Reader> reader(const std::string& topic, std::string_view type,
                                 const EndpointQos& qos, std::function<void(Sample)> receive);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cosegraph::graph
