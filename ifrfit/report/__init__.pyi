from .figures import plot as plot
from .folder import write_folder as write_folder
from .page.writing import check_report as check_report
from .page.writing import write_report as write_report
from .tables import html as html
from .terminal import side_by_side as side_by_side
from .terminal import summary as summary
