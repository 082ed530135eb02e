#include "formats/hdf5/structure.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <span>
#include <system_error>
#include <utility>

#include "formats/bytes/file_bytes.h"
#include "formats/bytes/little_endian.h"
#include "formats/hdf5/messages.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::array<std::uint8_t, 8> kHdf5Signature = {0x89, 'H',  'D',  'F',
                                                        '\r', '\n', 0x1A, '\n'};
constexpr std::size_t kSuperblockBytes = 96;
constexpr std::size_t kHeaderPrefixBytes = 16;
constexpr std::size_t kNodePrefixBytes = 24;
constexpr std::size_t kHeapBytes = 32;
constexpr std::size_t kSymbolPrefixBytes = 8;
constexpr std::size_t kSymbolBytes = 40;
// Ours have 15 at most.
constexpr std::size_t kMostNames = 64;
// A million million chunks would need no more.
constexpr int kMostLevels = 8;

enum class NodeType : std::uint8_t { kGroup = 0, kChunks = 1 };

bool has_signature(std::span<const std::uint8_t> bytes, const char* four) {
  return bytes.size() >= 4 && std::memcmp(bytes.data(), four, 4) == 0;
}

// A node of a B-tree of version 1 (section III.A.1): keys around the children.
struct Node {
  int level = 0;
  std::vector<std::span<const std::uint8_t>> keys;  // before each child
  std::vector<std::uint64_t> children;
  std::vector<std::uint8_t> bytes;
};

}  // namespace

// Reads through addresses, all of which the file may have chosen.
class Hdf5Structure::Parser {
 public:
  Parser(std::filesystem::path path, std::uint64_t end) : path_(std::move(path)), end_(end) {}

  // The address of the root group's object header. Sets the end of what is HDF5's.
  Result<std::uint64_t> read_superblock() {
    const Error foreign = {"it is no HDF5 file of the kind that qmpipe writes"};
    const auto bytes = read_file_range(path_, 0, kSuperblockBytes);
    if (!bytes) return foreign;
    ByteCursor cursor(*bytes);
    const bool is_hdf5 =
        std::memcmp(bytes->data(), kHdf5Signature.data(), kHdf5Signature.size()) == 0;
    cursor.skip(kHdf5Signature.size());
    // Versions of the superblock and of what it leads to, then the bytes of an address and a size.
    const std::array<int, 8> numbers = {cursor.u8(), cursor.u8(), cursor.u8(), cursor.u8(),
                                        cursor.u8(), cursor.u8(), cursor.u8(), cursor.u8()};
    if (!is_hdf5 || numbers != std::array<int, 8>{0, 0, 0, 0, 0, 8, 8, 0}) {
      return foreign;
    }
    cursor.skip(8);  // sizes of nodes, which say themselves how full they are; flags
    const std::uint64_t base = cursor.u64();
    cursor.skip(8);  // free space
    end_ = cursor.u64();
    cursor.skip(8 + 8);  // driver information; the root's name
    if (base != 0) return Error{"its addresses do not begin at its first byte"};
    // All that is read is bounded by this, so it must not be what the file alone says.
    std::error_code unknown;
    const std::uintmax_t size = std::filesystem::file_size(path_, unknown);
    if (unknown || end_ > size) return Error{"it is shorter than it says"};
    return cursor.u64();
  }
  std::uint64_t end() const { return end_; }

  Result<std::vector<std::uint8_t>> bytes_at(std::uint64_t address, std::uint64_t bytes) const {
    if (address > end_ || bytes > end_ - address) {
      return Error{fmt::format("it names {} bytes at byte {}, of {}", bytes, address, end_)};
    }
    return read_file_range(path_, address, bytes);
  }

  // The messages of an object header (section IV.A.1.a) and its continuations.
  Result<std::vector<Hdf5Message>> messages_at(std::uint64_t address) const {
    const auto prefix = bytes_at(address, kHeaderPrefixBytes);
    if (!prefix) return prefix.error();
    ByteCursor cursor(*prefix);
    if (cursor.u16() != 1) return Error{"an object header is of another version"};
    cursor.skip(2 + 4);  // number of messages, of references
    std::vector<ByteRange> blocks = {
        {.offset = address + kHeaderPrefixBytes, .bytes = cursor.u32()}};
    std::vector<Hdf5Message> messages;
    std::uint64_t room = end_;
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      // Blocks that name each other would go on for ever.
      const std::uint64_t taken = std::max<std::uint64_t>(blocks[k].bytes, 1);
      if (taken > room) return Error{"an object header is longer than the file"};
      room -= taken;
      const auto block = bytes_at(blocks[k].offset, blocks[k].bytes);
      if (!block) return block.error();
      if (const auto error = split_messages(*block, messages, blocks)) return *error;
    }
    return messages;
  }

  // A node of the given type and, where it is not negative, level.
  Result<Node> node_at(std::uint64_t address, NodeType type, std::size_t key_bytes,
                       int level) const {
    const auto prefix = bytes_at(address, kNodePrefixBytes);
    if (!prefix) return prefix.error();
    ByteCursor cursor(*prefix);
    cursor.skip(4);
    Node node;
    const auto own_type = cursor.u8();
    node.level = cursor.u8();
    const std::size_t entries = cursor.u16();
    // A group without names has an empty root; elsewhere one would make long ways to nothing.
    const bool is_empty = entries == 0 && (level >= 0 || node.level > 0);
    if (!has_signature(*prefix, "TREE") || own_type != static_cast<std::uint8_t>(type) ||
        node.level > kMostLevels || (level >= 0 && node.level != level) || is_empty) {
      return Error{"a node of an index is none, or one of another index"};
    }
    auto bytes = bytes_at(address + kNodePrefixBytes, entries * (key_bytes + 8));
    if (!bytes) return bytes.error();
    node.bytes = std::move(*bytes);
    for (std::size_t k = 0; k < entries; ++k) {
      const auto entry = std::span<const std::uint8_t>(node.bytes).subspan(k * (key_bytes + 8));
      node.keys.push_back(entry.first(key_bytes));
      node.children.push_back(load_little_endian<std::uint64_t>(entry.data() + key_bytes));
    }
    return node;
  }

  // The names of a group (sections III.B to III.D) and the addresses of their headers.
  std::optional<Error> read_group(const SymbolTable& table,
                                  std::map<std::string, std::uint64_t>& objects) const {
    const auto prefix = bytes_at(table.heap, kHeapBytes);
    if (!prefix) return prefix.error();
    ByteCursor cursor(*prefix);
    cursor.skip(8);
    const std::uint64_t heap_bytes = cursor.u64();
    cursor.skip(8);
    if (!has_signature(*prefix, "HEAP")) return Error{"its names are not where it says"};
    const auto heap = bytes_at(cursor.u64(), heap_bytes);
    if (!heap) return heap.error();
    return read_names(table.tree, -1, *heap, objects);
  }

  std::optional<Error> read_chunks(std::uint64_t address, int level, std::size_t rank,
                                   std::size_t limit, std::vector<LocatedChunk>& chunks) const {
    // Bytes, filters left out, and the first element in each dimension, those of an element too.
    const auto node = node_at(address, NodeType::kChunks, 8 + 8 * (rank + 1), level);
    if (!node) return node.error();
    for (std::size_t k = 0; k < node->children.size(); ++k) {
      if (node->level > 0) {
        if (auto error = read_chunks(node->children[k], node->level - 1, rank, limit, chunks)) {
          return error;
        }
        continue;
      }
      ByteCursor key(node->keys[k]);
      const std::uint64_t bytes = key.u32();
      const bool is_filtered = key.u32() == 0;
      const LocatedChunk chunk = {.row = key.u64(),
                                  .range = {.offset = node->children[k], .bytes = bytes}};
      bool is_first = true;
      for (std::size_t d = 0; d < rank; ++d) is_first = key.u64() == 0 && is_first;
      if (chunks.size() == limit) return Error{fmt::format("there are more than {} chunks", limit)};
      if (!is_filtered || !is_first || (!chunks.empty() && chunks.back().row >= chunk.row)) {
        return Error{fmt::format("chunk {} is none of qmpipe's", chunks.size())};
      }
      chunks.push_back(chunk);
    }
    return std::nullopt;
  }

 private:
  static std::optional<Error> split_messages(std::span<const std::uint8_t> block,
                                             std::vector<Hdf5Message>& messages,
                                             std::vector<ByteRange>& blocks) {
    constexpr std::uint8_t kShared = 2;
    ByteCursor cursor(block);
    while (cursor.left() >= 8) {
      Hdf5Message message;
      message.type = static_cast<Hdf5MessageType>(cursor.u16());
      const std::size_t bytes = cursor.u16();
      const std::uint8_t flags = cursor.u8();
      cursor.skip(3);
      const auto data = cursor.take(bytes);
      if (cursor.failed() || (flags & kShared) != 0) {
        return Error{"a message of an object header is cut off or stands elsewhere"};
      }
      if (message.type == Hdf5MessageType::kContinuation) {
        ByteCursor at(data);
        const std::uint64_t offset = at.u64();
        blocks.push_back({.offset = offset, .bytes = at.u64()});
        if (at.failed()) return Error{"a message of an object header is cut off"};
      }
      message.bytes.assign(data.begin(), data.end());
      messages.push_back(std::move(message));
    }
    return std::nullopt;
  }

  std::optional<Error> read_names(std::uint64_t address, int level,
                                  const std::vector<std::uint8_t>& heap,
                                  std::map<std::string, std::uint64_t>& objects) const {
    const auto node = node_at(address, NodeType::kGroup, 8, level);
    if (!node) return node.error();
    for (const std::uint64_t child : node->children) {
      auto error = node->level > 0 ? read_names(child, node->level - 1, heap, objects)
                                   : read_symbols(child, heap, objects);
      if (error) return error;
    }
    return std::nullopt;
  }

  std::optional<Error> read_symbols(std::uint64_t address, const std::vector<std::uint8_t>& heap,
                                    std::map<std::string, std::uint64_t>& objects) const {
    const auto prefix = bytes_at(address, kSymbolPrefixBytes);
    if (!prefix) return prefix.error();
    const std::size_t count = load_little_endian<std::uint16_t>(prefix->data() + 6);
    const auto symbols = bytes_at(address + kSymbolPrefixBytes, count * kSymbolBytes);
    if (!symbols) return symbols.error();
    if (!has_signature(*prefix, "SNOD") || count == 0) return Error{"a list of names is none"};
    ByteCursor cursor(*symbols);
    for (std::size_t k = 0; k < count; ++k) {
      const std::uint64_t name_at = cursor.u64();
      const std::uint64_t header = cursor.u64();
      // 2: a symbolic link.
      const bool is_link = cursor.u32() > 1;
      cursor.skip(4 + 16);
      if (name_at >= heap.size() || is_link) return Error{"it holds a link"};
      const auto end = std::find(heap.begin() + static_cast<std::ptrdiff_t>(name_at), heap.end(),
                                 std::uint8_t{0});
      // Each name is a new one, so that nodes which name each other end soon.
      if (objects.size() == kMostNames ||
          !objects
               .emplace(std::string(heap.begin() + static_cast<std::ptrdiff_t>(name_at), end),
                        header)
               .second) {
        return Error{"it holds more names than it should, or one twice"};
      }
    }
    return std::nullopt;
  }

  std::filesystem::path path_;
  std::uint64_t end_;
};

Result<Hdf5Structure> Hdf5Structure::read(const std::filesystem::path& path) {
  Parser parser(path, 0);
  const auto root = parser.read_superblock();
  if (!root) return root.error();
  const auto messages = parser.messages_at(*root);
  if (!messages) return messages.error();
  Hdf5Structure structure;
  structure.path_ = path;
  structure.end_ = parser.end();
  for (const Hdf5Message& message : *messages) {
    if (message.type == Hdf5MessageType::kAttribute) {
      auto attribute = parse_attribute(message.bytes);
      if (!attribute) return attribute.error();
      structure.attributes_.insert(std::move(*attribute));
    } else if (message.type == Hdf5MessageType::kSymbolTable) {
      const auto table = parse_symbol_table(message.bytes);
      if (!table) return table.error();
      if (const auto error = parser.read_group(*table, structure.objects_)) return *error;
    }
  }
  return structure;
}

const Hdf5Attribute* Hdf5Structure::attribute(const std::string& name) const {
  const auto it = attributes_.find(name);
  return it == attributes_.end() ? nullptr : &it->second;
}

Result<Hdf5Dataset> Hdf5Structure::dataset(const std::string& name) const {
  const auto it = objects_.find(name);
  if (it == objects_.end()) return Error{"there is none"};
  const auto messages = Parser(path_, end_).messages_at(it->second);
  if (!messages) return messages.error();
  return parse_dataset(*messages);
}

Result<std::vector<LocatedChunk>> Hdf5Structure::chunks(const Hdf5Dataset& dataset,
                                                        std::size_t limit) const {
  QMPIPE_CHECK(dataset.is_chunked);
  std::vector<LocatedChunk> chunks;
  if (dataset.chunk_index == kNoAddress) return chunks;
  if (const auto error =
          Parser(path_, end_)
              .read_chunks(dataset.chunk_index, -1, dataset.shape.size(), limit, chunks)) {
    return *error;
  }
  std::vector<ByteRange> ranges;
  for (const LocatedChunk& chunk : chunks) ranges.push_back(chunk.range);
  std::sort(ranges.begin(), ranges.end(),
            [](const ByteRange& a, const ByteRange& b) { return a.offset < b.offset; });
  std::uint64_t at = 0;
  for (const ByteRange& range : ranges) {
    if (range.offset < at || range.offset > end_ || range.bytes > end_ - range.offset) {
      return Error{"its chunks overlap or lie outside the file"};
    }
    at = range.offset + range.bytes;
  }
  return chunks;
}

Result<std::vector<std::uint8_t>> Hdf5Structure::values_of(const Hdf5Dataset& dataset) const {
  QMPIPE_CHECK(!dataset.is_chunked);
  return Parser(path_, end_).bytes_at(dataset.values.offset, dataset.values.bytes);
}

}  // namespace qmpipe
