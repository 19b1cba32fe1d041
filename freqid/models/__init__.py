from freqid.models.grey_box import GreyBox
