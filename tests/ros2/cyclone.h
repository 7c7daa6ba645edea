/* What both programs share: a topic of ROS 2 through Cyclone DDS. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cyclone_point_cloud2.h"
#include "dds/dds.h"

typedef sensor_msgs_msg_dds__PointCloud2_ PointCloud2;
#define PointCloud2_desc sensor_msgs_msg_dds__PointCloud2__desc

enum { kMostSeconds = 60 }; /* against waiting for ever */

static inline dds_entity_t checked(dds_entity_t entity, const char* what) {
  if (entity >= 0) return entity;
  fprintf(stderr, "%s: %s\n", what, dds_strretcode(entity));
  exit(1);
}

static inline dds_qos_t* qos_of(const char* reliability, int depth) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos,
                       strcmp(reliability, "reliable") == 0 ? DDS_RELIABILITY_RELIABLE
                                                            : DDS_RELIABILITY_BEST_EFFORT,
                       DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
  return qos;
}

static inline dds_entity_t topic_of(dds_entity_t participant, const char* name) {
  char full[256];
  snprintf(full, sizeof full, "rt%s", name);
  return checked(dds_create_topic(participant, &PointCloud2_desc, full, NULL, NULL), full);
}
