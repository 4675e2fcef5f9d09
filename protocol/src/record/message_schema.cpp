// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/message_schema.hpp"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <set>

namespace emit::protocol {
namespace {

/// Adds a file's descriptor behind those of its imports, each file once.
void add_with_imports(const google::protobuf::FileDescriptor& file, std::set<std::string>& added,
                      google::protobuf::FileDescriptorSet& out) {
  if (!added.insert(file.name()).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) {
    add_with_imports(*file.dependency(i), added, out);
  }
  file.CopyTo(out.add_file());
}

}  // namespace

std::string file_descriptor_set(const google::protobuf::Descriptor& message) {
  google::protobuf::FileDescriptorSet set;
  std::set<std::string> added;
  add_with_imports(*message.file(), added, set);
  return set.SerializeAsString();
}

}  // namespace emit::protocol
