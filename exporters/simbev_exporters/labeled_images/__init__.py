"""Foundation of the exports to layouts of labeled images: COCO, YOLO and KITTI."""
