#include "pipeline/build/tile_graph.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/flow_graph.h>
#include <oneapi/tbb/task_arena.h>

#include <array>
#include <atomic>

#include "scheduler/check.h"
#include "scheduler/ready_queue.h"

namespace qmpipe {
namespace {

namespace flow = tbb::flow;
// TBB copies messages; the tile itself is handed on, never shared between two nodes at a time.
using Message = std::shared_ptr<TileWork>;

class TileGraph {
 public:
  TileGraph(const BuildPlan& plan, const Heightfield& heightfield, BorderStore& borders,
            TileSink& sink, const TileGraphOptions& options, Progress& progress,
            const std::function<void(const TileWork&)>& on_tile);
  TileGraphResult run();

 private:
  Message window(const Message& work);
  Message mesh(const Message& work);
  Message finish(const Message& work);
  Message encode_tile(const Message& work);
  void store(const Message& work);
  void dispatch();
  FixedBorders inherited(const PlannedTile& planned);
  void publish(const PlannedTile& planned, const Tin& tin);
  std::vector<BufferFill> fills() const;
  void enter(Stage stage) { ++held_[static_cast<std::size_t>(stage)]; }
  void leave(Stage stage) { --held_[static_cast<std::size_t>(stage)]; }

  const BuildPlan& plan_;
  BorderStore& borders_;
  TileSink& sink_;
  const TileGraphOptions& options_;
  Progress& progress_;
  const std::function<void(const TileWork&)>& on_tile_;
  TileBuilder builder_;
  ReadyQueue queue_;
  std::int64_t tiles_done_;
  tbb::enumerable_thread_specific<GzipCompressor> compressors_;
  // Tiles that wait for a stage or are in it.
  std::array<std::atomic<std::int64_t>, kStageCount> held_{};

  flow::graph graph_;
  flow::function_node<Message, Message> window_node_;
  flow::function_node<Message, Message> mesh_node_;
  flow::function_node<Message, Message> finish_node_;
  flow::function_node<Message, Message> encode_node_;
  flow::sequencer_node<Message> sequencer_;
  flow::function_node<Message, flow::continue_msg> sink_node_;
};

TileGraph::TileGraph(const BuildPlan& plan, const Heightfield& heightfield, BorderStore& borders,
                     TileSink& sink, const TileGraphOptions& options, Progress& progress,
                     const std::function<void(const TileWork&)>& on_tile)
    : plan_(plan),
      borders_(borders),
      sink_(sink),
      options_(options),
      progress_(progress),
      on_tile_(on_tile),
      builder_(heightfield, plan.recipe),
      queue_(plan.wavefront, options.max_in_flight, options.first_tile),
      tiles_done_(options.first_tile),
      compressors_([level = options.gzip_level] { return GzipCompressor(level.value_or(1)); }),
      window_node_(graph_, flow::unlimited, [this](const Message& m) { return window(m); }),
      mesh_node_(graph_, flow::unlimited, [this](const Message& m) { return mesh(m); }),
      finish_node_(graph_, flow::unlimited, [this](const Message& m) { return finish(m); }),
      encode_node_(graph_, flow::unlimited, [this](const Message& m) { return encode_tile(m); }),
      sequencer_(graph_,
                 [first = options.first_tile](const Message& m) {
                   return static_cast<std::size_t>(m->index - first);
                 }),
      sink_node_(graph_, flow::serial, [this](const Message& m) {
        store(m);
        return flow::continue_msg();
      }) {
  flow::make_edge(window_node_, mesh_node_);
  flow::make_edge(mesh_node_, finish_node_);
  flow::make_edge(finish_node_, encode_node_);
  flow::make_edge(encode_node_, sequencer_);
  flow::make_edge(sequencer_, sink_node_);
}

// Any thread may call this at any time: pop() gives each tile to one caller only.
void TileGraph::dispatch() {
  while (!progress_.should_stop()) {
    const std::optional<TileIndex> index = queue_.pop();
    if (!index) return;
    auto work = std::make_shared<TileWork>();
    work->index = *index;
    work->key = plan_.wavefront.tiles[static_cast<std::size_t>(*index)].key;
    enter(Stage::kWindow);
    QMPIPE_CHECK(window_node_.try_put(work));
  }
}

Message TileGraph::window(const Message& work) {
  builder_.read_window(*work);
  leave(Stage::kWindow);
  enter(Stage::kMesh);
  return work;
}

FixedBorders TileGraph::inherited(const PlannedTile& planned) {
  FixedBorders fixed;
  for (const Side side : kSides) {
    if (planned.roles[index_of(side)] != SideRole::kHeir) continue;
    const TileIndex owner = planned.neighbours[index_of(side)];
    fixed[index_of(side)] =
        borders_.take(plan_.wavefront.tiles[static_cast<std::size_t>(owner)].key, opposite(side));
  }
  return fixed;
}

void TileGraph::publish(const PlannedTile& planned, const Tin& tin) {
  for (const Side side : kSides) {
    if (planned.roles[index_of(side)] == SideRole::kOwner) {
      borders_.publish(planned.key, side, border_of(tin, side));
    }
  }
}

Message TileGraph::mesh(const Message& work) {
  const PlannedTile& planned = plan_.wavefront.tiles[static_cast<std::size_t>(work->index)];
  builder_.simplify(*work, inherited(planned), planned);
  publish(planned, work->tin);
  queue_.publish(work->index);
  leave(Stage::kMesh);
  enter(Stage::kFinish);
  dispatch();
  return work;
}

Message TileGraph::finish(const Message& work) {
  builder_.finish(*work);
  leave(Stage::kFinish);
  enter(Stage::kEncode);
  return work;
}

Message TileGraph::encode_tile(const Message& work) {
  builder_.encode_bytes(*work, options_.gzip_level ? &compressors_.local() : nullptr);
  leave(Stage::kEncode);
  enter(Stage::kSink);
  return work;
}

void TileGraph::store(const Message& work) {
  {
    const StageClock clock(*work, Stage::kSink);
    sink_.write(work->key, work->bytes);
  }
  on_tile_(*work);
  leave(Stage::kSink);
  ++tiles_done_;
  queue_.retire(work->index);
  progress_.advance(1);
  dispatch();
}

std::vector<BufferFill> TileGraph::fills() const {
  std::vector<BufferFill> fills = {{.name = "ready", .filled = queue_.waiting_for_room()}};
  for (std::size_t k = 0; k < kStageCount; ++k) {
    fills.push_back({.name = kStageNames[k],
                     .filled = held_[k].load(std::memory_order_relaxed),
                     .capacity = options_.max_in_flight});
  }
  return fills;
}

TileGraphResult TileGraph::run() {
  {
    const Phase phase(progress_, {.name = "mesh",
                                  .unit = "tiles",
                                  .total = plan_.tile_count(),
                                  .done_before = options_.first_tile,
                                  .fills = [this] { return fills(); }});
    dispatch();
    graph_.wait_for_all();
  }
  const bool stopped = !queue_.all_retired();
  QMPIPE_CHECK(!stopped || progress_.should_stop());
  return {.tiles_done = tiles_done_,
          .largest_in_flight = queue_.largest_in_flight(),
          .stopped = stopped};
}

}  // namespace

TileGraphResult run_tile_graph(const BuildPlan& plan, const Heightfield& heightfield,
                               BorderStore& borders, TileSink& sink,
                               const TileGraphOptions& options, Progress& progress,
                               const std::function<void(const TileWork&)>& on_tile) {
  tbb::task_arena arena(options.threads);
  return arena.execute([&] {
    return TileGraph(plan, heightfield, borders, sink, options, progress, on_tile).run();
  });
}

}  // namespace qmpipe
