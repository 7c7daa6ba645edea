/* Prints the next COUNT messages of a topic of ROS 2, as Cyclone DDS decodes them:

     cyclone-echo DOMAIN /TOPIC reliable|best_effort COUNT

   A line for the message, one per field, one with the data in hexadecimal. */
#include "cyclone.h"

static void print(const PointCloud2* message) {
  printf("%s %d %u %u x %u big %d step %u row %u dense %d\n", message->header.frame_id,
         message->header.stamp.sec, message->header.stamp.nanosec, message->width, message->height,
         message->is_bigendian, message->point_step, message->row_step, message->is_dense);
  for (unsigned i = 0; i < message->fields._length; ++i) {
    const sensor_msgs_msg_dds__PointField_* field = &message->fields._buffer[i];
    printf("field %s %u %u %u\n", field->name, field->offset, field->datatype, field->count);
  }
  for (unsigned i = 0; i < message->data._length; ++i) printf("%02x", message->data._buffer[i]);
  printf("\n");
  fflush(stdout);
}

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const dds_entity_t participant =
      checked(dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL), "participant");
  dds_qos_t* qos = qos_of(argv[3], 10);
  const dds_entity_t reader =
      checked(dds_create_reader(participant, topic_of(participant, argv[2]), qos, NULL), "reader");
  int left = atoi(argv[4]);
  for (int i = 0; left > 0 && i < 100 * kMostSeconds; ++i) {
    void* sample = NULL;
    dds_sample_info_t info;
    while (left > 0 && dds_take(reader, &sample, &info, 1, 1) > 0) {
      if (info.valid_data) {
        print(sample);
        --left;
      }
      dds_return_loan(reader, &sample, 1);
      sample = NULL;
    }
    dds_sleepfor(DDS_MSECS(10));
  }
  dds_delete_qos(qos);
  dds_delete(participant);
  return left == 0 ? 0 : 1;
}
