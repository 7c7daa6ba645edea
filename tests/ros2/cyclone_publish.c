/* Publishes the points of a text file ("x y z" per line) on a topic of ROS 2, COUNT times, as a
   camera's driver may lay them out:

     cyclone-publish DOMAIN /TOPIC reliable|best_effort POINTS WIDTH FIELDS STEP PADDING big|little
                     COUNT MILLISECONDS

   WIDTH 0: unorganised. FIELDS: "NAME:TYPE:OFFSET,..." with the numbers of PointField's types; x, y
   and z are the point's, a field of another name holds 0x102030 + the point's number. STEP: bytes
   of a point; PADDING: bytes behind each row. The stamp of message i is i + 1 s and 500 ns. */
#include "cyclone.h"

static void put(unsigned char* to, const void* number, size_t size, int big) {
  for (size_t i = 0; i < size; ++i) to[i] = ((const unsigned char*)number)[big ? size - 1 - i : i];
}

static void put_typed(unsigned char* to, int type, double number, int big) {
  const float as_float = (float)number;
  const unsigned as_word = (unsigned)(number < 0 ? 0 : number);
  if (type == 8)
    put(to, &number, 8, big);
  else if (type == 7)
    put(to, &as_float, 4, big);
  else
    put(to, &as_word, type <= 2 ? 1 : type <= 4 ? 2 : 4, big);
}

/* Reads the points; returns how many. */
static unsigned read_points(const char* file, double** points) {
  FILE* stream = fopen(file, "r");
  unsigned count = 0;
  unsigned room = 0;
  double p[3];
  if (stream == NULL) {
    perror(file);
    exit(1);
  }
  while (fscanf(stream, "%lf %lf %lf", &p[0], &p[1], &p[2]) == 3) {
    if (count == room) *points = realloc(*points, (room = 2 * room + 64) * sizeof p);
    memcpy(*points + 3 * count++, p, sizeof p);
  }
  fclose(stream);
  return count;
}

static unsigned parse_fields(char* text, sensor_msgs_msg_dds__PointField_* fields) {
  unsigned count = 0;
  for (char* word = strtok(text, ","); word != NULL && count < 16; word = strtok(NULL, ",")) {
    unsigned type = 0;
    char* colon = strchr(word, ':');
    if (colon == NULL || sscanf(colon, ":%u:%u", &type, &fields[count].offset) != 2) exit(2);
    *colon = '\0';
    fields[count].name = word;
    fields[count].datatype = (unsigned char)type;
    fields[count++].count = 1;
  }
  return count;
}

static void fill(PointCloud2* message, const double* points) {
  const size_t size = (size_t)message->width * message->height;
  for (size_t i = 0; i < size; ++i) {
    unsigned char* point = message->data._buffer + i / message->width * message->row_step +
                           i % message->width * message->point_step;
    for (unsigned f = 0; f < message->fields._length; ++f) {
      const sensor_msgs_msg_dds__PointField_* field = &message->fields._buffer[f];
      const char* axis = strchr("xyz", field->name[0]);
      const int is_axis = axis != NULL && field->name[1] == '\0';
      put_typed(point + field->offset, field->datatype,
                is_axis ? points[3 * i + (size_t)(*axis - 'x')] : 0x102030 + (double)i,
                message->is_bigendian);
    }
  }
}

static void await_reader(dds_entity_t writer) {
  for (int i = 0; i < 100 * kMostSeconds; ++i) {
    dds_publication_matched_status_t status;
    dds_get_publication_matched_status(writer, &status);
    if (status.current_count > 0) return;
    dds_sleepfor(DDS_MSECS(10));
  }
  fprintf(stderr, "nobody reads the topic\n");
  exit(1);
}

int main(int argc, char** argv) {
  if (argc != 12) return 2;
  double* points = NULL;
  const unsigned size = read_points(argv[4], &points);
  const unsigned width = (unsigned)atoi(argv[5]);
  sensor_msgs_msg_dds__PointField_ fields[16];
  PointCloud2 message = {0};
  message.header.frame_id = "camera_optical";
  message.width = width > 0 ? width : size;
  message.height = size / message.width;
  message.fields._buffer = fields;
  message.fields._length = message.fields._maximum = parse_fields(argv[6], fields);
  message.is_bigendian = strcmp(argv[9], "big") == 0;
  message.point_step = (unsigned)atoi(argv[7]);
  message.row_step = message.point_step * message.width + (unsigned)atoi(argv[8]);
  message.data._length = message.data._maximum = message.row_step * message.height;
  message.data._buffer = calloc(message.data._length, 1);
  fill(&message, points);

  const dds_entity_t participant =
      checked(dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL), "participant");
  dds_qos_t* qos = qos_of(argv[3], 10);
  const dds_entity_t writer =
      checked(dds_create_writer(participant, topic_of(participant, argv[2]), qos, NULL), "writer");
  await_reader(writer);
  for (int i = 0; i < atoi(argv[10]); ++i) {
    message.header.stamp.sec = i + 1;
    message.header.stamp.nanosec = 500;
    checked(dds_write(writer, &message), "write");
    dds_sleepfor(DDS_MSECS(atoi(argv[11])));
  }
  if (strcmp(argv[3], "reliable") == 0) dds_wait_for_acks(writer, DDS_SECS(kMostSeconds));
  dds_delete_qos(qos);
  dds_delete(participant);
  free(message.data._buffer);
  free(points);
  return 0;
}
