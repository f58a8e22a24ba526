"""Export to the layout of COCO, with boxes and masks of instances, which pycocotools reads."""
